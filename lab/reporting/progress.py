"""Progress of a command: what it does, what compiles, and the time left; a bar on a terminal, else lines."""

from __future__ import annotations

import time
from typing import Self

import rich.progress
from rich.console import Console

from ...framework.compilation import log

REFRESH = 0.1  # s between two drawings of the bar
LINES = 5.0  # s between two lines where there is no terminal


class Progress:
    """Shows progress on ``console``, and the names of kernels while they compile, inside ``with``; else only counts.

    It has no thread, which would take time from the measurement.
    """

    def __init__(self, console: Console | None = None) -> None:
        self.done = 0.0
        self._console = console or Console(quiet=True)
        self._bar = rich.progress.Progress(
            rich.progress.TextColumn("{task.description}", style="bold", markup=False),
            rich.progress.BarColumn(bar_width=None), rich.progress.TaskProgressColumn(),
            rich.progress.TimeRemainingColumn(), "left", console=self._console, expand=True, auto_refresh=False,
            speed_estimate_period=120, disable=not self._console.is_terminal,
        )  # fmt: skip
        self._task = self._bar.add_task("starting", total=None)
        self._total: float | None = None
        self._what = ""
        self._shown = time.monotonic()

    def __enter__(self) -> Self:
        log.listeners.append(self._compiles)
        self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        log.listeners.remove(self._compiles)
        self._bar.stop()

    def begin(self, total: float) -> None:
        """Set the total amount of work, in any unit."""
        self.done, self._total = 0.0, total
        self._bar.update(self._task, total=total, completed=0.0)
        self._show(0.0)

    def say(self, what: str) -> None:
        """Show the current activity."""
        self._what = what
        self._bar.update(self._task, description=what)
        self._show(0.0)

    def advance(self, amount: float) -> None:
        """Add to the work done."""
        self.done += amount
        self._bar.update(self._task, completed=self.done, description=self._what)
        last = self._total is not None and self.done >= self._total
        self._show(0.0 if last else REFRESH)

    def _show(self, pause: float) -> None:
        """Draw the bar if ``pause`` s have gone by since; a line, if LINES have."""
        now = time.monotonic()
        terminal = self._console.is_terminal
        if now - self._shown < (pause if terminal else LINES):
            return
        self._shown = now
        if terminal:
            self._bar.refresh()
        else:
            share = f": {100 * min(self.done / self._total, 1):.0f} %" if self._total else ""
            self._line(f"{self._what}{share}")

    def _line(self, text: str) -> None:
        self._console.print(text, style="dim", highlight=False, markup=False, soft_wrap=True)

    def _compiles(self, kernel: str) -> None:
        if not log.announced:
            from ...framework.jit.cache import announcement  # loads numba

            self._line(announcement())
        left = f" ({log.left} left)" if log.left else ""
        text = f"{self._what}: compiling {kernel.rpartition('.')[2]}{left} ..."
        self._bar.update(self._task, description=text)
        if self._console.is_terminal:
            self._bar.refresh()
        elif time.monotonic() - self._shown >= LINES:
            self._shown = time.monotonic()
            self._line(text)


NO_PROGRESS = Progress()
