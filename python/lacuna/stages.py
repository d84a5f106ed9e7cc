"""Studies: checked, run, and searched for missing physics."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from . import _engine
from .command import name_command
from .progress import Listener, listener
from .results import Run

Study = str | os.PathLike | Mapping[str, Any]


def check(study: Study, **overrides: Any) -> None:
    """Check a study: a file, or a dictionary with the sections of one.

    Keyword arguments set keys, with two underscores for a point: ``sampler__steps=200``.

    Raises
    ------
    StudyError
        With all problems of the study, each with its place.
    """
    _engine.check(_source(study, overrides))


def run(
    study: Study,
    out: str | os.PathLike | None = None,
    *,
    progress: bool | Listener = True,
    **overrides: Any,
) -> Run:
    """Run all stages of a study, or those whose inputs have changed, and return the results.

    Parameters
    ----------
    study
        A study file, or a dictionary with the sections of one; relative paths in a dictionary start in the working
        directory.
    out
        Run directory. Default: ``runs/NAME`` with the name of the study.
    progress
        True for a progress bar (in notebooks a line that is updated), False for none, or a function that is called
        with each event: ``("begin", stage, unit, total)``, ``("advance", done)``, ``("expect", total)``
        (an estimate of a total that is not known), ``("end", stage, note)``, ``("warning", text)``,
        ``("note", text)``, ``("remark", text)``.
    overrides
        Keys of the study, with two underscores for a point: ``sampler__steps=200``.

    Raises
    ------
    StudyError
        With all problems of the study, each with its place.
    RunError
        If the run stops. What was computed is kept: the same call goes on with it, also after Ctrl-C.
    """
    return _pursue(study, out, "run", progress, overrides)[0]


def gap(
    study: Study,
    out: str | os.PathLike | None = None,
    *,
    progress: bool | Listener = True,
    **overrides: Any,
) -> tuple[Run, Run | None]:
    """Find physics that is missing in a study's model.

    Returns the run of the study, whose ``summary["gap"]`` names what is missing, and the run of the study with the
    effects that were added; None if nothing was added. Parameters as those of :func:`run`.
    """
    return _pursue(study, out, "gap", progress, overrides)


def _pursue(study, out, purpose, progress, overrides) -> tuple[Run, Run | None]:
    name_command()
    source = _source(study, overrides)
    folder = Path(out) if out is not None else Path("runs") / _name(study)
    with listener(progress) as tell:
        added = _engine.pursue(source, os.fspath(folder), purpose, tell)
    return Run(folder), None if added is None else Run(added)


def _source(study: Study, overrides: Mapping[str, Any]) -> dict[str, Any]:
    """The study as the engine takes it."""
    settings = [f"{key.replace('__', '.')}={_toml(value)}" for key, value in overrides.items()]
    if isinstance(study, Mapping):
        text = json.dumps(study, default=_plain)
        return {"path": os.path.join(os.getcwd(), "study.toml"), "json": text, "set": settings}
    return {"path": os.fspath(study), "json": None, "set": settings}


def _name(study: Study) -> str:
    """Name of a study's run directory."""
    if isinstance(study, Mapping):
        return str(study.get("study", {}).get("name", "study"))
    path = Path(study)
    try:
        import tomllib

        name = tomllib.loads(path.read_text(encoding="utf-8")).get("study", {}).get("name")
    except (ImportError, OSError, ValueError):
        name = None
    return str(name or path.stem)


def _plain(value: Any) -> Any:
    """Numbers and arrays of NumPy, and paths, as plain values."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"a study cannot contain {type(value).__name__}: {value!r}")


def _toml(value: Any) -> str:
    """A value as TOML on one line; JSON differs from it for tables only."""
    if isinstance(value, Mapping):
        pairs = (f"{json.dumps(str(key))} = {_toml(inner)}" for key, inner in value.items())
        return "{ " + ", ".join(pairs) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(inner) for inner in value) + "]"
    return json.dumps(value, default=_plain)
