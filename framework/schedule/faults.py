"""Faults: what went wrong without stopping the world, and how it is told."""

from __future__ import annotations

import logging
from collections.abc import Callable

from ..errors import FaultError, warn
from ..settings import Settings
from .clock import Clock

MOST_TEXTS = 100  # different texts
TOLD_AT_ONCE = 10  # in one step; a world that breaks as a whole does not fill the screen
REMEMBERED = 10_000  # kinds and bodies; beyond it everything may be told once more

logger = logging.getLogger("carom")


class Faults:
    """The faults of one world.

    texts
        the last 100 that differ; one for each kind and body, the newest, with how often and in which steps
    pending
        those that the step has found and that are to be told at its end
    """

    def __init__(self, settings: Callable[[], Settings], clock: Clock) -> None:
        self.texts: list[str] = []
        self.pending: list[str] = []
        self._settings, self._clock = settings, clock
        self._told: set[tuple[str, int | None]] = set()  # kinds and bodies
        self._lines: dict[tuple[str, int | None], tuple[str, int, int]] = {}  # newest text, count, first step

    def report(self, text: str, kind: str | None, entity: int | None) -> None:
        """Note a fault; ``kind`` and ``entity`` say which others it is like (None: only those with the same text)."""
        how, key = self._settings().on_fault, (text if kind is None else kind, entity)
        self._add_line(text, key, kind is not None)
        if how == "raise" or (how == "warn" and key not in self._told):
            if len(self._told) >= REMEMBERED:
                self._told.clear()
            self._told.add(key)
            self.pending.append(text)

    def _add_line(self, text: str, key: tuple[str, int | None], counts: bool) -> None:
        """The text, in place of what was reported of its kind and body until now."""
        step = self._clock.step_count
        old, count, first = self._lines.get(key, ("", 0, step)) if counts else ("", 0, step)
        if old in self.texts:
            self.texts.remove(old)
        when = f"steps {first} to {step}" if step != first else f"step {step}"
        line = f"{text} ({count + 1} times, {when})" if count else text
        if line not in self.texts:
            self.texts.append(line)
        del self.texts[:-MOST_TEXTS]
        if counts:
            if len(self._lines) >= REMEMBERED:
                self._lines.clear()
            self._lines[key] = line, count + 1, first

    @property
    def stopping(self) -> bool:
        """Whether there is something to raise."""
        return bool(self.pending) and self._settings().on_fault == "raise"

    def flush(self, where: str) -> None:
        """Warn of what is pending, or raise it; between two steps."""
        texts, self.pending = self.pending, []
        if len(texts) > TOLD_AT_ONCE:
            more = len(texts) - TOLD_AT_ONCE + 1
            texts[TOLD_AT_ONCE - 1 :] = [f"and {more} more faults like these, the last of them in world.faults"]
        if logger.hasHandlers():  # else Python would print them a second time
            for text in texts:
                logger.warning(text)
        if self._settings().on_fault == "raise":
            raise FaultError(f"{where}: {'; '.join(texts)} (the step is complete)")
        for text in texts:
            warn(text)
