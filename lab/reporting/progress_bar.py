"""The progress bar of all measurements, redrawn only when work is done, with the time left."""

from __future__ import annotations

from types import TracebackType
from typing import Self

import rich.progress
from rich.console import Console

from ...framework.compilation import log


class Progress:
    """Counts, but shows nothing."""

    def __init__(self) -> None:
        self.done = 0.0

    def begin(self, total: float, done: float = 0.0) -> None:
        """Set the total amount of work, in any unit, and the part done by an earlier process."""
        self.done = done

    def say(self, what: str) -> None:
        """Show the current activity."""

    def advance(self, amount: float) -> None:
        """Add to the work done."""
        self.done += amount


NO_PROGRESS = Progress()


class Bar(Progress):
    """A context manager that shows a bar on ``console``, and the names of kernels while they compile.

    It has no thread, which would take time from the measurement.
    """

    def __init__(self, console: Console) -> None:
        super().__init__()
        self._bar = rich.progress.Progress(
            rich.progress.TextColumn("[bold]{task.description}"),
            rich.progress.BarColumn(bar_width=None),
            rich.progress.TaskProgressColumn(),
            rich.progress.TimeRemainingColumn(),
            rich.progress.TextColumn("left"),
            console=console,
            expand=True,
            auto_refresh=False,
            speed_estimate_period=120,
        )
        self._task = self._bar.add_task("starting", total=None)
        self._what = ""

    def __enter__(self) -> Self:
        log.listeners.append(self._compiles)
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        log.listeners.remove(self._compiles)
        self._bar.stop()

    def begin(self, total: float, done: float = 0.0) -> None:
        """Set the total amount of work, in any unit, and the part done by an earlier process.

        That part fills the bar and is not used for the time left.
        """
        super().begin(total, done)
        self._bar.update(self._task, total=total, completed=done)
        self._bar.refresh()

    def say(self, what: str) -> None:
        """Show the current activity."""
        self._what = what
        self._bar.update(self._task, description=what)
        self._bar.refresh()

    def advance(self, amount: float) -> None:
        """Add to the work done."""
        super().advance(amount)
        self._bar.update(self._task, completed=self.done, description=self._what)
        self._bar.refresh()

    def _compiles(self, kernel: str) -> None:
        self._bar.update(self._task, description=f"{self._what}: compiling {kernel.rpartition('.')[2]} ...")
        self._bar.refresh()
