"""Lacuna closes the gap between simulation and measurement.

>>> import lacuna
>>> run = lacuna.run("study.toml", out="runs/study")
>>> run.summary["parameters"]["rate"]["mean"]
>>> run.posterior.mean()

Plugins in Python are classes with the decorators `model`, `quantity`, `effect`, `discrepancy`, `sampler`, `surrogate` and
`reader`; see `lacuna.plugin`.
"""

from ._engine import RunError, StudyError, __version__
from .command import name_interpreter
from .plugin import (
    Complaint,
    Rejected,
    discrepancy,
    effect,
    fault,
    model,
    option,
    quantity,
    reader,
    sampler,
    surrogate,
    unknown,
)
from .results import Emulator, Posterior, Run, load
from .stages import check, gap, run

name_interpreter()

__all__ = [
    "Complaint",
    "Emulator",
    "Posterior",
    "Rejected",
    "Run",
    "RunError",
    "StudyError",
    "__version__",
    "check",
    "discrepancy",
    "effect",
    "fault",
    "gap",
    "load",
    "model",
    "option",
    "quantity",
    "reader",
    "run",
    "sampler",
    "surrogate",
    "unknown",
]
