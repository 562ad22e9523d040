"""The progress bar: what compiles, how many steps are done, at what rate, and how long it will still take."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn

from ..framework.compilation import log

REFRESH = 0.1  # s between two updates of the numbers


class StepProgress:
    """A context manager around a run: call :meth:`done` after each step.

    The rate is that of the steps since the last compilation, so that the time left does not jump with the
    first step.
    """

    def __init__(self, console: Console, name: str, steps: int) -> None:
        self._name, self._steps = name, steps
        self._bar = Progress(
            SpinnerColumn(),
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=None),
            MofNCompleteColumn(),
            TextColumn("{task.fields[rate]}"),
            console=console,
            expand=True,
        )
        self._task = self._bar.add_task(f"{name}: starting", total=steps, rate="")
        self._since = (time.perf_counter(), 0)  # when the counting began, and with how many steps done
        self._shown = 0.0
        self._compiling = False

    def __enter__(self) -> Self:
        log.listeners.append(self._compiles)
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        log.listeners.remove(self._compiles)
        self._bar.stop()

    def done(self, steps: int) -> None:
        """``steps`` steps have been taken so far."""
        now = time.perf_counter()
        if self._compiling:
            self._compiling = False
            self._since = (now, steps)
            self._shown = 0.0
        if now - self._shown < REFRESH and steps < self._steps:
            return
        self._shown = now
        seconds, counted = now - self._since[0], steps - self._since[1]
        rate = ""
        if counted and seconds > 0:
            per_second = counted / seconds
            left = (self._steps - steps) / per_second
            rate = f"{per_second:,.0f} steps/s" + (f", {_clock(left)} left" if steps < self._steps else "")
        self._bar.update(self._task, completed=steps, description=f"{self._name}: stepping", rate=rate)

    def _compiles(self, kernel: str) -> None:
        self._compiling = True
        name = kernel.rpartition(".")[2]
        self._bar.update(self._task, description=f"{self._name}: compiling {name} ...", rate="")
        self._bar.refresh()


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return (
        f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"
        if whole >= 3600
        else f"{whole // 60}:{whole % 60:02}"
    )
