"""Lacuna closes the gap between simulation and measurement.

>>> import lacuna
>>> run = lacuna.run("study.toml", out="runs/study")
>>> run.summary["parameters"]["rate"]["mean"]
>>> run.posterior.mean()
"""

from ._engine import RunError, StudyError, __version__
from .results import Emulator, Posterior, Run, load
from .stages import check, gap, run

__all__ = [
    "Emulator",
    "Posterior",
    "Run",
    "RunError",
    "StudyError",
    "__version__",
    "check",
    "gap",
    "load",
    "run",
]
