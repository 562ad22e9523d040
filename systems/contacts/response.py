"""RESPONSE: what contacts do to the bodies: impacts first, at their times, then contacts at rest."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...framework.schedule.phases import Phase
from ...framework.schedule.stages import Program, PythonPart, Rows, Stage
from ...framework.world.contacts import Contacts
from ...framework.world.world import World
from ..impacts.stages import ROOM_FOR_IMPACTS, begin_impacts, resolve_impacts
from ..joints.bodies import count_turns
from ..parts.stages import place_parts
from ..stage_system import StagedSystem
from .bodies import ROOM_AT_REST, gather, put_back
from .events import disabled_pairs
from .resting import find_resting, find_touching, linearise
from .solving.prediction import ROOM_FOR_SUPPORT, predict_rest
from .solving.records import RESTED
from .solving.solver import solve_contacts, solve_turning_contacts
from .solving.warm_start import ROOM_TO_STORE, match_warm_start, store_warm_start
from .stages import ROOM_FOR_CONTACTS, begin_response, publish_contacts
from .static_penetration import resolve_static_penetration

MOVED_COLUMNS = ("position", "linear_velocity", "path_velocity")
EITHER, RESTING, RESTING_OR_JOINED = "colliders or joints", "contacts may rest", "contacts may rest or joints"
BODIES_NEAR, REST = "bodies are near each other", "contacts rest"


class Response(StagedSystem):
    """Bounces pairs that approach, at the time they meet on their path, and holds those that rest.

    Reads the contacts and their ``enabled``, the path of the step, restitution, friction; writes position,
    linear_velocity and the contacts' normal_impulse, and logs the impacts.
    """

    phase = Phase.RESPONSE
    writes = ("normal_impulse",)
    STAGES = (
        Stage(begin_response, "where the paths begin", ("pairs",), ("path_velocity",), EITHER),
        Stage(
            predict_rest, "what held bodies acts on the prediction, as far as there is something to hold",
            ("warm_start",), MOVED_COLUMNS, RESTING_OR_JOINED, RESTED, ROOM_FOR_SUPPORT,
        ),
        Stage(begin_impacts, "no impact yet", ("pairs", "restitution"), ("impacts",), "colliders"),
        Stage(
            resolve_impacts, "impacts at their time on the path, in order", ("pairs", "restitution", "friction"),
            (*MOVED_COLUMNS, "impacts"), "impacts", BODIES_NEAR, ROOM_FOR_IMPACTS,
        ),
        Stage(
            find_resting, "which pairs neither bounce nor are apart", ("pairs", *MOVED_COLUMNS), ("pairs",),
            "colliders", BODIES_NEAR,
        ),
        Stage(
            gather, "the resting bodies and their contacts, by island and colour; substeps of each island",
            MOVED_COLUMNS, ("solver",), RESTING_OR_JOINED, REST, ROOM_AT_REST,
        ),
        Stage(
            linearise, "normal and gap of each contact at rest", MOVED_COLUMNS, ("solver", "pairs"), RESTING, REST
        ),
        Stage(
            match_warm_start, "the impulses of the step before, to start with", ("warm_start",), ("solver",),
            RESTING, REST,
        ),
        Stage(
            solve_contacts, "substeps: forces, warm start, push, move, relax, guard", ("solver",), ("solver",),
            "no body spins, no joints", REST,
        ),
        Stage(
            solve_turning_contacts, "the same, with the arms of the contacts, and joints before these", ("solver",),
            ("solver",), "bodies spin or joints", REST,
            (Rows("solver.direct", ("values",), lambda s: s.solver.direct.blocks),),
        ),
        Stage(put_back, "where the resting bodies are at the end", ("solver",), MOVED_COLUMNS, RESTING_OR_JOINED, REST),
        Stage(
            place_parts, "parts go where contacts have sent and turned their bodies", MOVED_COLUMNS,
            (*MOVED_COLUMNS, "rotation"), "parts",
        ),
        Stage(count_turns, "how far joints in space have turned", ("rotation",), ("solver",), "joints"),
        Stage(
            resolve_static_penetration, "pushes bodies out of static and kinematic bodies", ("pairs",), MOVED_COLUMNS,
            RESTING, BODIES_NEAR,
        ),
        Stage(
            store_warm_start, "the impulses, for the next step", ("solver",), ("warm_start",), RESTING, REST,
            ROOM_TO_STORE,
        ),
        Stage(find_touching, "which pairs touch in the end", MOVED_COLUMNS, ("pairs",), "colliders", BODIES_NEAR),
        Stage(
            publish_contacts, "the contacts of the step", ("pairs",), ("contacts",), "contacts",
            room=ROOM_FOR_CONTACTS,
        ),
    )  # fmt: skip

    def __init__(self, program: Program, contacts: Contacts, world: World) -> None:
        super().__init__(program)
        self._state, self._contacts, self._world = program.state, contacts, world

    def _parts(self) -> list[Any]:
        if not self._state.others_write:
            return [self.segment()]
        return [PythonPart(self.name, self._take_disabled), self.segment()]

    def _take_disabled(self, dt: float) -> None:
        """Pairs whose contact a system has disabled push no more in this step."""
        pairs, disabled = self._state.pairs, disabled_pairs(self._state, self._contacts)
        pairs.is_solid[disabled] = False

    def reason(self) -> str:
        if not self._state.collides:
            return "no colliders: nothing to do"
        mode = self._world.settings.collision
        if mode == "event_driven":
            what = "all impacts at their true time, in order, then contacts at rest"
        elif mode == "continuous":
            what = "impacts at their time on the path, what is fast where it first touches, then contacts at rest"
        elif self._state.sweeping:
            what = "impacts at their time on the path, bodies with ccd where they first touch, then contacts at rest"
        elif not self.may_bounce():
            what = "contacts at rest; nothing bounces: every restitution is 0"
        else:
            what = "impacts at their time on the path, then contacts at rest"
        return what + self._islands()

    def _islands(self) -> str:
        """The islands of the last step and their substeps."""
        solver, usual = self._state.solver, self._state.substeps
        if not solver.islands:
            return ""
        substeps = solver.substeps_of[: solver.islands]
        refined = int(np.count_nonzero(substeps > usual))
        more = f", {refined} of them with up to {substeps.max()}" if refined else ""
        return f"; {_count(solver.contacts, 'row')}, {_count(solver.islands, 'island')} with {usual} substeps{more}"

    def may_bounce(self) -> bool:
        """Whether some collider has a restitution."""
        restitution = self._state.colliders.restitution[:, : self._state.count]
        return bool(np.any(restitution != 0.0))


def _count(number: int, name: str) -> str:
    return f"{number} {name}" + "s" * (number != 1)
