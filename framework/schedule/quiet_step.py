"""The step of a world in which nothing has changed since the last one and no code of the game runs: one flat function.

It does what ``Pipeline._take(1)`` does in that case, over names that are looked up once: a world of few bodies spends
more time between its stages than in them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..data import esper_bridge
from .stages import Segment


def make_quiet_step(pipeline: Any, physics: Any) -> Callable[[], bool] | None:
    """A function that takes a step and returns True, or False, and nothing has happened, if there is more to do.

    None if other parts of a step than the stages are Python.
    """
    parts = pipeline.parts
    if [type(part) for part in parts] != [Segment] or pipeline.order.foreign:
        return None
    (stages,), order, processors, events = parts, pipeline.order, pipeline.processors, pipeline.world.events
    program, start, stop, call = stages.program, stages.start, stages.stop, stages.program.call
    contents, clock, faults, profiler = pipeline.contents, pipeline.clock, pipeline.faults, pipeline.profiler
    changes, dead, registry = contents.log, contents.dead, pipeline.world.registry
    table, scene, links, sleepers = physics.table, physics.scene, physics.links, physics.sleepers
    unsettled, contacts, open_window = physics.plugin_stages.unsettled, physics.contacts, physics.contacts.open_window
    words, alarm = program.state.words, program.alarm
    number, found, pushed = map(program.state.word_of, ("step_number", "found_current", "pushed"))
    acquire, release = esper_bridge.stepping.acquire, esper_bridge.stepping.release
    order_version, parts_version = order.version, physics.parts_version

    def step() -> bool:
        if (
            changes.dirty or dead or processors.changed or order.version != order_version or table.kind_changed
            or table.version + table.members_version + registry.version != scene.structure
            or table.static_version != scene.static_version or physics.parts_version != parts_version
            or links.version != scene.version or physics.must_check or unsettled() or sleepers.on
            or table.driven or events.of_esper or (events.handlers and events.any_handlers())
        ):  # fmt: skip
            return False
        if not acquire(False):
            return False  # where it is said why
        try:
            count, dt = clock.step_count, clock.dt
            table.frame += 1
            open_window(count)
            words[number] = count
            physics.contacts_before = contacts.columns_now() if words[found] else None
            try:
                code = call(start, stop, dt)
                if code or words[alarm]:
                    pipeline.resume(program, code, stop, dt)
            except BaseException as error:
                pipeline.mark_running(True)  # for what goes back to its start
                pipeline.fail_at_work(error)
                raise
            if words[found]:
                contacts.columns_now()
            if words[pushed] or table.frames_applied:
                physics.end_window()
            clock.step_count = count + 1
            profiler.steps += 1
            if faults.pending:
                pipeline.tell_faults()
        finally:
            release()
        return True

    return step
