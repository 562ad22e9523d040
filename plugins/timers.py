"""Timers: ``World(Physics(), Timers())``, then entities with a ``Timer(seconds)``, and the event ``timer``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from ..framework import Component, Phase, Plugin, System, column
from ..framework.data.columns import special_column
from ..framework.data.component import NOTHING

__all__ = ["Timer", "Timers"]

SHORTEST = 1e-6  # s
ROUNDING = 1e-9  # of a step, as of the clock: 60 steps of 1/60 s are a second


class Timer(Component):
    """Sends the event ``timer`` once this many seconds of the world have passed, and is removed; or again and again.

    seconds
        s, at least 1e-6; a timer that runs takes another number at the start of the next step, as if it had had it
        since it began or was last due
    repeat
        whether it begins again when it is due, to the bit where it would be without rounding to steps
    """

    __slots__ = ()
    plugin: ClassVar[str] = "timers"

    seconds: float = column(minimum=SHORTEST, unit="s")
    repeat: bool = column(default=False, dtype=bool)
    # Not for the constructor: the time from which it counts, how often it has been due since, and with which seconds.
    started: float | None = special_column(default=None, optional=True, init=False, unit="s")
    count: int = special_column(default=0, dtype=int, init=False)
    period: float | None = special_column(default=None, optional=True, init=False, unit="s")

    def check_in(self, contents: Any, entity: int | None, beside: Mapping[type[Any], Any] = NOTHING) -> None:
        """It begins anew with the next step, unless an entity of this world has it still."""
        if self._entity is None or contents.components_of(self._entity).get(Timer) is not self:
            self.started, self.count, self.period = None, 0, None

    def left(self, time: float) -> float:
        """Seconds until it is due, at that ``time`` of the world: ``timer.left(world.time)``."""
        if self.started is None or self.period is None:
            return self.seconds
        return self.started + (self.count + 1) * self.period - time


class Timers(Plugin):
    """Counts the timers of a world, in steps: they stand still while it does."""

    def __init__(self) -> None:
        super().__init__("timers", version="1.0", needs_physics=True)
        self.component(Timer)
        self.event("timer")
        self.system(StartTimers)
        self.system(FireTimers)


class OfTimers(System):
    """Looks at all timers: those of bodies are rows of the table, others are handles."""

    _rounds, _loose = -1, []

    def loose(self) -> list[tuple[int, Timer]]:
        """The timers of entities that are no bodies, as they were at the start of the step."""
        contents = self.world._contents()
        log = contents.log
        if log.rounds != self._rounds:
            members = contents.members.get(Timer)
            found = () if members is None else self.world.physics.adoption.loose(Timer, members.listed)
            self._rounds, self._loose = log.rounds, sorted({*found} - log.touched)
        found = ((entity, contents.entities.get(entity, {}).get(Timer)) for entity in self._loose)
        return [(entity, timer) for entity, timer in found if timer is not None]

    def rows(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """The rows of bodies that take part and have a timer, and the arrays of its columns."""
        table = self.world.physics.table
        arrays = [table.arrays[each.key] for each in Timer.columns.values()]
        return np.flatnonzero(table.has_mask(Timer)[: table.count] & ~self.world.physics.excluded()), arrays


class StartTimers(OfTimers):
    """Timers that are new begin to count, and those whose seconds were set count with these."""

    phase = Phase.START

    def process(self, dt: float) -> None:
        time = self.world.time
        rows, arrays = self.rows()
        if len(rows):
            seconds, _, started, count, period = arrays
            rows = rows[period[rows] != seconds[rows]]
            runs = ~np.isnan(started[rows])
            started[rows] = np.where(runs, started[rows] + count[rows] * period[rows], time)
            count[rows], period[rows] = 0, seconds[rows]
        for _, timer in self.loose():
            started, period = timer.started, timer.period
            if period != timer.seconds:
                timer.started = time if started is None or period is None else started + timer.count * period
                timer.count, timer.period = 0, timer.seconds


class FireTimers(OfTimers):
    """Sends the event of each timer that is due by the end of the step, in order of the entities."""

    phase = Phase.END
    _fired: tuple[tuple[int, int, int, Timer], ...] = ()  # entity, row or -1, how often it has been due by now, timer

    def on_add(self, world: Any) -> None:
        """What fired goes on when nothing can undo the step any more."""
        world.physics.plugin_stages.finishers.append(self._finish)

    def on_remove(self, world: Any) -> None:
        world.physics.plugin_stages.finishers.remove(self._finish)

    def process(self, dt: float) -> None:
        end = self.world.time + dt
        end += ROUNDING * dt + 4.0 * np.spacing(end)
        due: list[tuple[int, int, int]] = []
        rows, arrays = self.rows()
        if len(rows):
            _, _, started, count, period = (array[rows] for array in arrays)
            passed = np.floor((end - started) / period)
            which = np.flatnonzero(passed > count)  # not where it has not begun
            entities = self.world.physics.table.column("entity")[rows[which]]
            due += zip(entities.tolist(), rows[which].tolist(), passed[which].astype(int).tolist(), strict=True)
        for entity, timer in self.loose():
            if timer.started is not None and timer.period is not None:
                passed = int((end - timer.started) / timer.period)
                if passed > timer.count:
                    due.append((entity, -1, passed))
        self._fired, fired = (), []
        for entity, row, passed in sorted(due):
            timer = self._running(entity)
            if timer is not None:
                self.world.events.dispatch("timer", entity, timer)
                fired.append((entity, row, passed, timer))
        self._fired = tuple(fired)

    def _finish(self, world: Any) -> None:
        for entity, row, passed, timer in self._fired:
            if self._running(entity) is timer:
                self._go_on(entity, row, passed, timer)
        self._fired = ()

    def _running(self, entity: int) -> Timer | None:
        """The entity's timer, if it has begun: what handlers have put there or deleted is none."""
        timer = self.world.try_component(entity, Timer) if self.world.entity_exists(entity) else None
        return None if timer is None or timer.started is None else timer

    def _go_on(self, entity: int, row: int, passed: int, timer: Timer) -> None:
        if not timer.repeat:
            if len(self.world.components_for_entity(entity)) == 1:
                self.world.delete_entity(entity)
            else:
                self.world.remove_component(entity, Timer)
        elif row >= 0:  # unseen by what wakes sleepers and finds static bodies anew
            self.world.physics.table.arrays[Timer.columns["count"].key][row] = passed
        else:
            timer.count = passed
