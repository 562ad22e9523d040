"""Progress of a command: what compiles, the number of steps done, their rate, and the time left."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn

from ...framework.compilation import log
from ...framework.jit.cache import CACHE_FOLDER_VARIABLE, cache_folder

REFRESH = 0.1  # s between two updates of the numbers


class Compiling:
    """The text shown when a compilation begins: the kernel, the number so far, and once the cache folder."""

    def __init__(self) -> None:
        self._before = (len(log.compiled), log.seconds)
        self._shown = False

    def words(self, kernel: str) -> str:
        """The text for ``kernel``, named as in the log."""
        count, seconds = len(log.compiled) - self._before[0], log.seconds - self._before[1]
        so_far = f"{count} so far, {seconds:.1f} s" if count else ""
        left = f"{log.left} left" if log.left else ""
        numbers = ", ".join(filter(None, (left, so_far)))
        return f"compiling {kernel.rpartition('.')[2]}{f' ({numbers})' if numbers else ''} ..."

    def show_cache_folder(self, console: Console) -> None:
        """Print where the kernels are kept; at the first call only."""
        if self._shown:
            return
        self._shown = True
        folder = cache_folder()
        text = f"kept in {folder} for next time"
        if folder is None:
            text = f"not kept: there is no folder that can be written ({CACHE_FOLDER_VARIABLE} names one)"
        console.print(f"first use: kernels are compiled, and {text}", style="dim", highlight=False, soft_wrap=True)


class StepProgress:
    """A context manager around a run: call :meth:`done` after each step.

    The rate is measured since the last compilation, so that the time left does not jump after the first
    step.
    """

    def __init__(self, console: Console, name: str, steps: int) -> None:
        self._console, self._name, self._steps = console, name, steps
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
        self._since = (time.perf_counter(), 0)  # start of the measurement, and the steps done then
        self._shown = 0.0
        self._words = Compiling()
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
        """Report that ``steps`` steps have been taken so far."""
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
        self._words.show_cache_folder(self._console)
        self._bar.update(self._task, description=f"{self._name}: {self._words.words(kernel)}", rate="")
        self._bar.refresh()


class CompileStatus:
    """A context manager that reports compilations on ``console``; for work without a progress bar."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._words = Compiling()
        self._what = ""
        self._status = console.status("starting")

    def __enter__(self) -> Self:
        log.listeners.append(self._compiles)
        self._status.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        log.listeners.remove(self._compiles)
        self._status.stop()

    def say(self, what: str) -> None:
        """Show the current activity."""
        self._what = what
        self._status.update(what)

    def _compiles(self, kernel: str) -> None:
        self._words.show_cache_folder(self._console)
        self._status.update(f"{self._what}: {self._words.words(kernel)}")


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return (
        f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"
        if whole >= 3600
        else f"{whole // 60}:{whole % 60:02}"
    )
