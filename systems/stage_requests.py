"""What Python does between two stages, for each code that a stage returns."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from . import codes
from .record_buffers import make_room


def handlers(simulation: Any) -> dict[int, Callable[[float], None]]:
    """By code; each takes dt. ``simulation`` has the systems that run when a phase before them has not."""
    sleepers, quarantine = simulation.sleepers, simulation.quarantine
    return {
        codes.NEED_ROOM: lambda dt: reserve(simulation),
        codes.NEED_SWEEPS: lambda dt: simulation.link(),
        codes.NEED_IMPACTS: lambda dt: simulation.links.link_impacts(),
        codes.NEED_TOGETHER: lambda dt: simulation.links.link_together(),
        codes.NEED_REST: lambda dt: simulation.links.link_rest(),
        codes.FIND_IN_PYTHON: partial(find_candidates, simulation),
        codes.REFRESH_PAIRS: partial(refresh_pairs, simulation),
        codes.ROTATE: lambda dt: simulation.scene.refresh_rotation(),
        codes.RUN_BROAD: simulation.broad_phase.process,
        codes.RUN_NARROW: simulation.narrow_phase.process,
        codes.CHECK_COLUMNS: quarantine.check_columns,
        codes.CHECK_FLIGHT: quarantine.check_flight,
        codes.LOOK: lambda dt: sleepers.look(),
        codes.FAULTS: simulation.contact_events.report_faults,
        codes.INDEX: lambda dt: simulation.search.index_for_stages(simulation.scene),
        codes.WAKE: lambda dt: sleepers.wake_disturbed(),
        codes.WAKE_TOUCHED: partial(sleepers.wake_touched, simulation),
    }


def reserve(simulation: Any) -> None:
    """The rows that the stage asks for."""
    stage = simulation.program.stages[simulation.state.stage]
    make_room(stage, simulation.state, simulation.plugin_stages.own(stage), simulation.scene.make)


def find_candidates(simulation: Any, dt: float) -> None:
    """Trees, which from now on hold whole motions, or the broad phase of a plugin."""
    simulation.search.find_in_python(dt)
    simulation.queries.forget()


def refresh_pairs(simulation: Any, dt: float) -> None:
    """An impact has sent a body out of its search bounds: pairs for what is left of the step."""
    state, program = simulation.state, simulation.program
    program.run_one("box_rest_of_step", dt)
    found = simulation.broad_phase.segment("place_statics")
    found(dt)
    while simulation.sleepers.wake_candidates(dt):
        found(dt)
    program.run_one("order_candidates", dt)
    simulation.narrow_phase.filter_candidates()
    program.run_one("merge_pairs", dt)
    state.pairs, state.merged = state.merged, state.pairs
    state.impacts.until = state.neighbours_known_until
