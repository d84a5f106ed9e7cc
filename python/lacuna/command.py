"""The ``lacuna`` command in a Python interpreter."""

import os
import shutil
import signal
import sys
from pathlib import Path

from . import _engine


def main() -> int:
    """Run the command with the arguments of the process and return its exit code."""
    # The command ends at Ctrl-C and at a closed pipe as programs do, not by exceptions of the interpreter.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    name_command()
    return _engine.command(["lacuna", *sys.argv[1:]])


def name_interpreter() -> None:
    """Name the running interpreter for files of plugins, unless the environment names another one."""
    os.environ.setdefault("LACUNA_PYTHON", sys.executable)


def name_command() -> None:
    """Name the command for the processes that make simulation runs; the running program is an interpreter."""
    if "LACUNA_PROGRAM" in os.environ:
        return
    beside = Path(sys.executable).with_name("lacuna")
    command = str(beside) if beside.exists() else shutil.which("lacuna")
    if command:
        os.environ["LACUNA_PROGRAM"] = command
