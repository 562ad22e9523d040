"""The machinery of a step: how it opens and closes, windows of steps, and what happens if something raises inside."""

from __future__ import annotations

import time
from typing import Any

import esper

from ..compilation import log
from ..data import esper_bridge
from ..errors import CaromError, StepError
from .clock import Clock
from .faults import Faults
from .no_physics import NoPhysics
from .phases import FIRST_PRIORITY, Phase, System
from .profiler import Profiler
from .quiet_step import make_quiet_step
from .stages import PythonPart, Segment, merged
from .system_order import SystemOrder

LONG_FRAME = 2.0  # s: two such frames in a row that lose steps were meant as something else

class Pipeline(esper.Processor):
    """Owns the order of a world's systems and its clock, and takes its steps.

    It is the first of a world's processors, which runs the whole step, the other processors included.
    """

    def __init__(self, world: Any) -> None:
        self.world = world
        self.clock = Clock(world.settings.dt)
        self.order = SystemOrder(world, self)
        self.in_step = False
        self.profiler = Profiler(self)
        self.faults = Faults(lambda: world.settings, self.clock)
        self._events = world.events
        self._in_window = False
        self._was_too_long = False  # the frame before
        self.parts: list[Any] = []  # what a step runs, in order
        self._parts_order = self._parts_physics = -1  # versions that the parts were made of
        self._quiet: Any = None  # takes the step of a world in which nothing changes
        self._at = ""  # the system at work
        self.processors: esper_bridge.Processors
        self.contents: esper_bridge.Contents
        self.physics: Any  # what a plugin provides, or NoPhysics

    def attach(self) -> None:
        """Become the first processor of the world's context; called in it."""
        self.processors = esper_bridge.take_over_processors()
        self.contents = esper_bridge.Contents()
        self.physics = NoPhysics(self.contents)
        esper.add_processor(self, FIRST_PRIORITY)

    def must_be_between_steps(self, what: str) -> None:
        if self.in_step:
            raise CaromError(f"{what} between steps only, not inside one")

    # -- stepping ---------------------------------------------------------------------------------

    def step(self) -> None:
        if self.in_step:
            self.must_be_between_steps("a step can be taken")
        if self._quiet is None or not self._quiet():
            self._take(1)

    def advance(self, seconds: float) -> int:
        self.must_be_between_steps("advance can be called")
        dropped = self.clock.dropped_steps
        steps = self.clock.gather(seconds, self.world.settings.max_steps_per_advance)
        too_long = seconds >= LONG_FRAME and self.clock.dropped_steps > dropped
        if too_long and self._was_too_long:
            self.world.report_fault(
                f"advance takes seconds, and frame after frame was given more than it may step, now {seconds:g}: "
                f"milliseconds, as pygame's clock gives them, are advance(milliseconds / 1000)",
                kind="frames",
            )  # fmt: skip
        self._was_too_long = too_long
        before = self.clock.step_count
        try:
            if steps != 1 or self._quiet is None or not self._quiet():
                self._take(steps)
        except BaseException:  # the time of the steps that were not taken is still there
            self.clock.gathered += (steps - (self.clock.step_count - before)) * self.clock.dt
            raise
        for system in tuple(self.order.frame_systems):
            with esper_bridge.context(self.world.name):
                system.process(seconds)
        return steps

    def _claim(self) -> None:
        """The step is this thread's; CaromError while another thread takes one, of this world or another."""
        if not esper_bridge.stepping.acquire(blocking=False):
            raise CaromError(
                f"world {self.world.name!r} cannot be stepped while another thread steps a world: esper has one "
                f"current context for all threads, so step all worlds of a process in one thread, or use processes"
            )

    def _take(self, steps: int) -> None:
        self._claim()
        try:
            self._take_steps(steps)
        finally:
            esper_bridge.stepping.release()

    def _take_steps(self, steps: int) -> None:
        """Some steps whose events are gathered together."""
        self._open_window()
        if not steps:  # new bodies are adopted all the same, so that they know which frame it is
            self.synchronize()
            return
        self._in_window = True
        try:
            for k in range(steps):
                if k:
                    self.physics.take_deferred()
                others_write = self.others_write()
                if self.contents.dead:
                    self.contents.clear_dead()
                if others_write or self.processors.changed:  # code of the game needs its context
                    with esper_bridge.context(self.world.name):
                        esper.process(self.clock.dt)
                else:
                    self._run(self.clock.dt, False)
                if self.faults.pending and self.faults.stopping:
                    break
        finally:
            self._in_window = False
        self._close_window()

    def process(self, *args: Any, **kwargs: Any) -> None:
        """One step, called by esper's ``process()`` in the world's context."""
        if self.in_step:
            raise CaromError("a step cannot be taken inside a step")
        args = (*args, *kwargs.values())
        dt = self.world.settings.dt
        if len(args) != 1 or args[0] != dt:
            raise ValueError(
                f"esper.process({', '.join(map(repr, args))}): this world's step is fixed, settings.dt = {dt!r}; "
                f"for frames of any length use world.advance(seconds)"
            )
        self._claim()
        try:
            alone = not self._in_window
            if alone:
                self._open_window()
            if self.processors.changed:
                self.order.reconcile()
            self._run(dt, self.others_write())
            self.processors.step_done = True
            if alone:
                self._close_window()
        finally:
            esper_bridge.stepping.release()

    def _run(self, dt: float, others_write: bool) -> None:
        """Open the step, run its parts, close it."""
        self.synchronize()
        waited, order, physics = log.waited, self.order, self.physics
        self._begin(others_write)
        if self._parts_order != order.version or self._parts_physics != physics.parts_version:
            self._make_parts()
        self._run_parts(self.parts, dt)
        try:
            physics.end_step()
        except BaseException as error:
            self.fail("closing the step", error)
            raise
        self.mark_running(False)
        self.clock.step_count += 1
        self.profiler.steps += 1
        if log.waited != waited:
            self.profiler.wait(log.waited - waited)
        if order.changed:
            with esper_bridge.context(self.world.name):
                order.apply()

    def _run_parts(self, parts: list[Any], dt: float) -> None:
        try:
            for part in parts:
                kind = type(part)
                if kind is Segment:
                    part.program.run(part.start, part.stop, dt)
                elif kind is PythonPart:
                    self.run_python(part, dt)
                elif part.words[part.index]:
                    self.run_python(part.part, dt)
        except BaseException as error:
            self.fail_at_work(error)
            raise

    def fail_at_work(self, error: BaseException) -> None:
        """The system at work has raised that."""
        at, self._at = self._at or self._system_at(), ""
        self.fail(f"system {at}" if at else "a stage of no system", error)

    def run_python(self, part: PythonPart, dt: float) -> None:
        """A system in Python: its time is taken, less that of stages inside and what it has waited for the compiler."""
        self._at = part.name
        program = self.physics.program
        inside, waited, started = program.inside, log.waited, time.perf_counter()
        part.function(dt)
        seconds = time.perf_counter() - started - (log.waited - waited)
        self.profiler.add(part.name, seconds - (program.inside - inside))
        self._at = ""

    @property
    def at(self) -> str:
        """The Python system at work, or the one for whose stage Python does something; "" if there is none."""
        return self._at or (self._system_at() if self.in_step else "")

    def _system_at(self) -> str:
        """The system whose stage ran last."""
        return self.physics.system_of_stage(self.physics.program.state.stage)

    # -- what a step runs -------------------------------------------------------------------------

    def others_write(self) -> bool:
        """Whether code that is not carom's runs in a step."""
        return self.order.foreign or self._events.any_handlers()

    def _make_parts(self) -> None:
        """The parts of all processors in esper's order, between those that open and close a step."""
        physics, debug = self.physics, self.world.settings.debug
        parts: list[Any] = [*physics.opening_stages()]
        for processor in self.order.in_esper_order():
            parts += parts_of(processor)
            if debug:
                name = name_of(processor)
                parts.append(PythonPart(name, lambda dt, name=name: physics.report_faults(f"after {name}: ")))
        self.parts = merged([*parts, *physics.closing_stages()])
        self._parts_order, self._parts_physics = self.order.version, physics.parts_version
        self._quiet = make_quiet_step(self, physics)

    def look_ahead(self) -> None:
        """Between two steps: know what the next one will do."""
        self.synchronize()
        if not self.in_step:
            self.physics.look_ahead(self.others_write())

    # -- opening and closing ----------------------------------------------------------------------

    def mark_running(self, on: bool) -> None:
        """Whether Python can see that a step of this world is at work."""
        self.in_step = on
        (esper_bridge.running.add if on else esper_bridge.running.discard)(self.world.name)

    def resume(self, program: Any, code: int, stop: int, dt: float) -> None:
        """Do what a stage of a quiet step has asked for, and the rest of that step."""
        waited, table = log.waited, self.physics.table
        table.in_step = True
        self.mark_running(True)
        program.resume(code, stop, dt)
        self.mark_running(False)
        table.in_step = False
        if log.waited != waited:
            self.profiler.wait(log.waited - waited)

    def _begin(self, others_write: bool) -> None:
        self.mark_running(True)
        try:
            self.physics.begin_step(others_write)
        except BaseException as error:
            if hasattr(error, "__notes__"):  # they say where: in a function of a plugin, in a handler
                self.fail("opening the step", error)
            self.roll_back()
            raise

    def _open_window(self) -> None:
        self.physics.open_window(self.clock.step_count)

    def _close_window(self) -> None:
        self.physics.end_window()
        if self.faults.pending:
            self.tell_faults()

    def tell_faults(self) -> None:
        self.faults.flush(f"step {self.clock.step_count - 1} of world {self.world.name!r}")

    def synchronize(self) -> None:
        """Bring the table in step with esper, unless a step is running: its rows stand still."""
        if not self.in_step and not self.physics.settled():
            self.physics.synchronize()

    def run(self, phase: Phase) -> None:
        """One phase alone; the clock stands still. If it raises, all is as it was before."""
        self.must_be_between_steps("a phase can be run")
        with esper_bridge.context(self.world.name):
            if self.processors.changed:
                self.order.reconcile()
            self.synchronize()
            self.physics.take_deferred()
            self._begin(True)
            parts = [*self.physics.opening_stages()]
            for system in [s for s in self.order.systems if s.phase == phase]:
                parts += parts_of(system)
            self._run_parts(merged(parts), self.world.settings.dt)
            self.physics.end_phase()
            self.mark_running(False)
            self.order.apply()
        if self.faults.pending:
            self.tell_faults()

    # -- when something raises --------------------------------------------------------------------

    def fail(self, what: str, error: BaseException) -> None:
        """A system, or something else in a step, has raised: back to its start, and an error that says what failed."""
        step = self.clock.step_count
        undone = self.roll_back()
        if isinstance(error, StepError) or not isinstance(error, Exception):
            return
        where = "".join(f"{note}: " for note in getattr(error, "__notes__", ()))
        raise StepError(
            f"{what} failed in step {step} of world {self.world.name!r}: {where}{type(error).__name__}: {error}"
            + (" (carom's columns and clock are back at the start of the step)" if undone else "")
        ) from error

    def roll_back(self) -> bool:
        """Back to the start of an unfinished step, if there is one."""
        if not self.in_step:
            return False
        self.mark_running(False)
        self.physics.abandon_step()
        with esper_bridge.context(self.world.name):
            self.order.apply()
        return True


def name_of(processor: esper.Processor) -> str:
    """What a processor is called in messages and in ``stats()``."""
    return processor.name if isinstance(processor, System) else type(processor).__name__


def parts_of(processor: esper.Processor) -> list[Any]:
    """What a step runs for a processor: its stages, if it is a built-in system, else its ``process``."""
    if isinstance(processor, System):
        parts = processor.parts()
        if parts is not None:
            return parts
    return [PythonPart(name_of(processor), lambda dt: processor.process(dt))]
