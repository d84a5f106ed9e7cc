"""Progress of a run in a terminal or a notebook."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Listener = Callable[..., Any]


@contextmanager
def listener(progress: bool | Listener) -> Iterator[Listener]:
    """The function that is called with the events of a run."""
    if callable(progress):
        yield progress
    elif progress:
        display = Display()
        try:
            yield display
        finally:
            display.clear()
    else:
        yield _warnings


def _warnings(kind: str, *details: Any) -> None:
    if kind == "warning":
        warnings.warn(details[0], stacklevel=2)


class Display:
    """One line with the current stage, its progress and the time that remains; finished stages stay above it."""

    def __init__(self, out=None) -> None:
        self.out = out or sys.stderr
        self.live = in_notebook() or getattr(self.out, "isatty", lambda: False)()
        self.width = 0
        self.stage, self.unit, self.total = "", "", 0
        self.about = False
        self.begun = time.monotonic()
        self.first: tuple[int, float] | None = None

    def __call__(self, kind: str, *details: Any) -> None:
        """Show an event."""
        if kind == "begin":
            self.stage, self.unit, self.total = details
            self.begun, self.first, self.about = time.monotonic(), None, False
            self._show(self.stage)
        elif kind == "advance":
            self._show(self._line(details[0]))
        elif kind == "expect":
            (self.total,), self.about = details, True
        elif kind == "end":
            stage, note = details
            self._say(f"{stage:<10} {time.monotonic() - self.begun:8.2f} s   {note}")
        elif kind == "warning":
            self._say(f"warning: {details[0]}")
        else:
            self._say(details[0])

    def clear(self) -> None:
        """Remove the line of the current stage."""
        if self.live and self.width:
            self.out.write("\r" + " " * self.width + "\r")
            self.out.flush()
            self.width = 0

    def _line(self, done: int) -> str:
        now = time.monotonic()
        if self.first is None:
            self.first = (done, now)
        if not self.total or done > self.total:
            return f"{self.stage:<10} {done} {self.unit}s"
        of, about = (" of about ", "about ") if self.about else ("/", "")
        line = f"{self.stage:<10} {done}{of}{self.total} {self.unit}s"
        before, since = self.first
        if done > before and now > since:
            left = (self.total - done) * (now - since) / (done - before)
            line += f", {about}{duration(left)} left"
        return line

    def _show(self, line: str) -> None:
        if self.live:
            self.out.write("\r" + line.ljust(self.width))
            self.out.flush()
            self.width = len(line)

    def _say(self, line: str) -> None:
        self.clear()
        self.out.write(line + "\n")
        self.out.flush()


def duration(seconds: float) -> str:
    """A duration as people say it."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def in_notebook() -> bool:
    """Return True in a Jupyter kernel."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return shell is not None and type(shell).__name__ == "ZMQInteractiveShell"
