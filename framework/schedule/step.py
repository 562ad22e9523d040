"""The machinery of a step: how it opens and closes, windows of steps, and what happens if something raises inside."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import esper

from ..data import esper_bridge
from ..errors import CaromError, StepError
from ..world import snapshots
from .clock import Clock
from .phases import FIRST_PRIORITY, LAST_PRIORITY, Phase
from .profiler import Measurements
from .system_order import Lineup

if TYPE_CHECKING:
    from ..world.world import World


class _Opening(esper.Processor):
    """First of all processors."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline = pipeline

    def process(self, *args: Any, **kwargs: Any) -> None:
        self._pipeline.open_step(*args, *kwargs.values())


class _Closing(esper.Processor):
    """Last of all processors."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline = pipeline

    def process(self, *args: Any, **kwargs: Any) -> None:
        self._pipeline.close_step()


class Pipeline:
    """Owns a world's line-up and clock; esper calls it back at the start and the end of every process()."""

    OWN = (_Opening, _Closing)

    def __init__(self, world: World) -> None:
        self.world = world
        self.clock = Clock(world.settings.dt)
        self.lineup = Lineup(self)
        self.in_step = False
        self.measurements = Measurements(self)
        self.faults: list[str] = []
        self._in_window = False
        self._unfinished: snapshots.StepState | None = None

    def attach(self) -> None:
        esper.add_processor(_Opening(self), FIRST_PRIORITY)
        esper.add_processor(_Closing(self), LAST_PRIORITY)

    def must_be_between_steps(self, what: str) -> None:
        if self.in_step:
            raise CaromError(f"{what} between steps only, not inside one")

    # -- stepping ---------------------------------------------------------------------------------

    def step(self) -> None:
        self.must_be_between_steps("a step can be taken")
        self._take(1)

    def advance(self, seconds: float) -> int:
        self.must_be_between_steps("advance can be called")
        steps = self.clock.gather(seconds, self.world.settings.max_steps_per_advance)
        before = self.clock.step_count
        try:
            self._take(steps)
        except BaseException:  # the time of the steps that were not taken is still there
            self.clock.gathered += (steps - (self.clock.step_count - before)) * self.clock.dt
            raise
        for system in tuple(self.lineup.frame_systems):
            with esper_bridge.context(self.world.name):
                system.process(seconds)
        return steps

    def _take(self, steps: int) -> None:
        """Some steps whose events are gathered together."""
        self._open_window()
        if not steps:  # new bodies are taken in all the same, so that they know which frame it is
            self.synchronize()
            return
        self._in_window = True
        try:
            with esper_bridge.context(self.world.name):
                for _ in range(steps):
                    esper_bridge.forget_unknown_dead()
                    esper.process(self.world.settings.dt)
        finally:
            self._in_window = False
            if self.in_step:  # a processor without a guard raised: added to esper itself while the step was running
                self.roll_back()
        self._close_window()

    def open_step(self, *args: Any) -> None:
        if self.in_step and self.measurements.at is not None:
            raise CaromError("a step cannot be taken inside a step")
        self.roll_back()  # what a step has left behind that broke off under plain esper without anybody noticing
        dt = self.world.settings.dt
        if len(args) != 1 or args[0] != dt:
            raise ValueError(
                f"esper.process({', '.join(map(repr, args))}): this world's step is fixed, settings.dt = {dt!r}; "
                f"for frames of any length use world.advance(seconds)"
            )
        if not self._in_window:
            self._open_window()
        self.lineup.reconcile()
        self.synchronize()
        self._begin(self._others_write())

    def _others_write(self) -> bool:
        """Whether code that is not carom's runs in a step."""
        return self.lineup.foreign or self.world.events.any_handlers()

    def look_ahead(self) -> None:
        """Between two steps: know what the next one will do."""
        self.synchronize()
        if self.world.physics is not None and not self.in_step:
            self.world.physics.look_ahead(self._others_write())

    def _begin(self, everything_kept: bool) -> None:
        physics = self.world.physics
        self._set_in_step(True)
        if physics is None:
            return
        self._unfinished = snapshots.capture(physics, self.clock, everything_kept)
        physics.table.in_step = True
        try:
            physics.begin_step()
        except BaseException:
            self.roll_back()
            raise

    def close_step(self) -> None:
        physics = self.world.physics
        if physics is not None:
            physics.table.in_step = False
            physics.end_step()
        self._set_in_step(False)
        self._unfinished = None
        self.clock.step_count += 1
        self.measurements.step_taken()
        if not self._in_window:
            self._close_window()
        if self.lineup.changed:
            self.lineup.apply_after_step()

    def _set_in_step(self, running: bool) -> None:
        self.in_step = running
        (esper_bridge.running.add if running else esper_bridge.running.discard)(self.world.name)

    def _open_window(self) -> None:
        if self.world.physics is not None:
            self.world.physics.contacts.open_window()
            self.world.physics.table.frame += 1

    def _close_window(self) -> None:
        if self.world.physics is not None:
            self.world.physics.end_window()

    def synchronize(self) -> None:
        """Bring the table in step with esper, unless a step is running: its rows stand still."""
        physics = self.world.physics
        if physics is None or self.in_step or physics.adoption.settled():
            return
        with esper_bridge.context(self.world.name):
            physics.adoption.synchronize()

    def run(self, phase: Phase) -> None:
        """One phase alone; the clock stands still. If it raises, all is as it was before."""
        self.must_be_between_steps("a phase can be run")
        with esper_bridge.context(self.world.name):
            self.lineup.reconcile()
            self.synchronize()
            self._begin(True)
            for system in [s for s in self.lineup.systems if s.phase == phase]:
                system.process(self.world.settings.dt)
        self._unfinished = None
        self._set_in_step(False)
        if self.world.physics is not None:
            self.world.physics.table.in_step = False
        self.lineup.apply()

    # -- when something raises --------------------------------------------------------------------

    def fail(self, name: str, error: BaseException) -> None:
        """A processor has raised: back to the start of the step, and an error that names it."""
        step = self.clock.step_count
        undone = self.roll_back()
        if isinstance(error, StepError) or not isinstance(error, Exception):
            return
        where = "".join(f"{note}: " for note in getattr(error, "__notes__", ()))
        raise StepError(
            f"system {name} failed in step {step} of world {self.world.name!r}: {where}{type(error).__name__}: {error}"
            + (" (carom's columns and clock are back at the start of the step)" if undone else "")
        ) from error

    def roll_back(self) -> bool:
        """Back to the start of an unfinished step, if there is one."""
        if not self.in_step:
            return False
        self._set_in_step(False)
        state, self._unfinished = self._unfinished, None
        physics = self.world.physics
        if state is not None and physics is not None:
            snapshots.put_back(state, physics, self.clock)
            physics.abandon_step()
            physics.table.in_step = False
        self.lineup.apply()
        return True
