"""The progress bar of all that is measured: drawn when something is done only, with the time left."""

from __future__ import annotations

from types import TracebackType
from typing import Self

import rich.progress
from rich.console import Console

from ...framework.compilation import log


class Progress:
    """Counts, and shows nothing."""

    def __init__(self) -> None:
        self.done = 0.0

    def begin(self, total: float, done: float = 0.0) -> None:
        """How much there is to do, in any unit, and how much of it an earlier process has done."""
        self.done = done

    def say(self, what: str) -> None:
        """What is being done."""

    def advance(self, amount: float) -> None:
        """So much more is done."""
        self.done += amount


NO_PROGRESS = Progress()


class Bar(Progress):
    """A context manager that shows a bar on ``console``, and the names of kernels while they compile.

    It has no thread of its own, which would take time from what is measured.
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
        """How much there is to do, in any unit, and how much of it an earlier process has done.

        That part fills the bar and does not count for the time left.
        """
        super().begin(total, done)
        self._bar.update(self._task, total=total, completed=done)
        self._bar.refresh()

    def say(self, what: str) -> None:
        """What is being done."""
        self._what = what
        self._bar.update(self._task, description=what)
        self._bar.refresh()

    def advance(self, amount: float) -> None:
        """So much more is done."""
        super().advance(amount)
        self._bar.update(self._task, completed=self.done, description=self._what)
        self._bar.refresh()

    def _compiles(self, kernel: str) -> None:
        self._bar.update(self._task, description=f"{self._what}: compiling {kernel.rpartition('.')[2]} ...")
        self._bar.refresh()
