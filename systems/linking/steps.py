"""What the steps of one world call: compiled or loaded before a step, its address written into the world's records."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...framework.jit.link_all import link_all
from ...framework.jit.linkable import Linkable
from ...framework.jit.linking import Linked
from ...framework.schedule.stages import Program, Stage
from ..broad_phase.search import CandidateSearch
from ..ccd.search_bounds import DISCRETE
from ..integration.system import Integration
from ..plugin_stages.plugin_stages import PluginStages
from ..records import SWEEP_COLUMNS
from ..scene import Scene
from ..stage_list import LINKED_PARTS
from .parts import PLACES, TAKE_TOGETHER, linked_part, needed_places
from .preparation import kind_of_world, link_possible

NEVER_LINKED = -1


class StepLinks:
    """Follows the scene: which stages, parts of stages and functions of shapes its steps need."""

    def __init__(
        self,
        scene: Scene,
        program: Program,
        integration: Integration,
        search: CandidateSearch,
        plugin_stages: PluginStages,
    ) -> None:
        self._scene, self._state, self._program = scene, scene.state, program
        self._integration, self._search, self._plugin_stages = integration, search, plugin_stages
        self._joints, self._parts = self._state.solver.joints, self._state.parts
        self._state.links = self._state.solver.addresses = np.zeros(len(PLACES), np.int64)
        self.version = NEVER_LINKED  # of the scene
        self._forces = NEVER_LINKED, False  # how many force systems there were, and whether some of them turn
        self._joined = False, False  # there are joints, and parts of bodies
        self._bounces = False  # some collider does, or has
        self._rests = False  # contacts may rest, or have
        self._turns = False  # contacts turn bodies
        self._key: Any = None  # what the linked stages depend on
        self._usual: Any = None  # what of that bodies may change
        self._shapes_key: Any = None
        self._kept_key: Any = None

    def follows(self, force_systems: tuple[int, bool]) -> bool:
        """Whether nothing has changed since the last time that makes other functions necessary."""
        joined = self._have_joints_and_parts()
        return self._scene.version == self.version and force_systems == self._forces and joined == self._joined

    def _have_joints_and_parts(self) -> tuple[bool, bool]:
        return self._joints.count > 0, self._parts.count > 0

    def needs_sweeps(self) -> bool:
        """Whether some body is swept: all of them in the mode, or those whose ccd is set."""
        state, table = self._state, self._scene.table
        ccd = table.arrays.get("ccd")
        return state.collides and (state.mode != DISCRETE or (ccd is not None and bool(ccd[: table.stops[1]].any())))

    def forget(self) -> None:
        """Other settings: link again before the next step."""
        self.version, self._key = NEVER_LINKED, None

    def link(self, force_systems: tuple[int, bool]) -> bool:
        """Compile or load what the step needs, and see to what later steps and queries may need.

        True if these are other stages than before; bodies that come and go seldom change that.
        """
        self.version = NEVER_LINKED  # until it is done
        scene, state = self._scene, self._state
        collides = state.collides
        joined = self._joined = self._have_joints_and_parts()
        state.sweeps_ready = sweeps = collides and self.needs_sweeps()
        if collides and not self._bounces:
            self._bounces = bool(np.any(state.colliders.restitution[:, : state.count]))
        if collides and not self._rests:
            self._rests = self._expects_rest()
        usual = (
            scene.linked, scene.registry.version, scene.table.capacity, force_systems, sweeps, collides,
            state.several_levels, state.dynamic > 0, self._search.needs_grids(), state.sleeping,
            self._plugin_stages.present(), joined, len(state.colliders.one_way) > 0, self._rests,
            self._bounces,
        )  # fmt: skip
        if self._key is not None and usual == self._usual and collides:  # bodies have come or gone, no more
            self.link_shapes()  # there may have been a query meanwhile, with other shapes
            self.version = scene.version
            return False
        self._usual = usual
        conditions = self._conditions()
        key = (scene.linked, scene.registry.version, scene.table.capacity, force_systems, conditions)
        changed = key != self._key
        if changed:
            self._key = None
            self._integration.prepare()
            if state.sweeps_ready:
                scene.reserve(*SWEEP_COLUMNS)
            self._link_stages(conditions)
            self._link_possible()
            self._key = key
        self.link_shapes()
        self.version, self._forces = scene.version, force_systems
        return changed

    def _expects_rest(self) -> bool:
        """Whether contacts at rest are likely in the next steps. They are not between elastic bodies that do not turn:
        their stages compile in the background then, and the first contact at rest waits for them."""
        state, memory, plugins = self._state, self._state.warm_start, self._plugin_stages
        turns = any(
            "spin" in each.writes and found for each, found in zip(plugins.stages, plugins.present(), strict=True)
        )
        if turns or state.sleeping or any(self._joined) or memory.counts.any():
            return True
        restitution, shaped = state.colliders.restitution[:, : state.count], state.bodies.shape[: state.count] >= 0
        return restitution.size == 0 or not bool(np.all(restitution.max(axis=0)[shaped] == 1.0))

    def _link_stages(self, conditions: dict[str, bool]) -> None:
        """The stages whose condition is met, and what these call."""
        state = self._state
        self._turns = conditions["bodies spin or joints"]
        state.rest_ready = conditions["contacts may rest"]

        def wanted(stage: Stage) -> bool:
            return conditions.get(stage.needed, False)

        parts = self._parts_by_address()
        link_all((*self._functions_of_shapes(), *parts.values(), *self._program.functions(wanted)))
        for place, part in parts.items():
            state.links[place] = part.address
        self._program.link(wanted)

    def _conditions(self) -> dict[str, bool]:
        """What is true of the scene now, as in ``stage_list.CONDITIONS``."""
        state = self._state
        moves, collides, (joined, parted) = state.dynamic > 0, state.collides, self._joined
        rests = collides and self._rests
        met = {
            "": True,
            "dynamic bodies": moves,
            "colliders": collides,
            "joints": joined,
            "parts": parted,
            "colliders or joints": collides or joined,
            "impacts": collides and (self._bounces or state.sweeps_ready),
            "contacts may rest": rests,
            "contacts may rest or joints": rests or joined,
            "contacts": collides or bool(state.contacts.counts.any()) or state.asleep > 0,  # sleepers have theirs
            "one level": collides and not state.several_levels,
            "several levels": collides and state.several_levels,
            "many bodies": collides and self._search.needs_grids(),
            "swept bodies": state.sweeps_ready,
            "one-way colliders": collides and len(state.colliders.one_way) > 0,
            "sleeping": collides and state.sleeping,
            **dict.fromkeys(self._integration.stages_needed, moves),
        }
        return {**met, **self._plugin_stages.conditions(met)}

    def _functions_of_shapes(self) -> Iterator[Linkable]:
        linked = self._scene.linked
        if linked is not None:
            yield from linked.all_functions(self._sweeps(), self._scene.moments_asked)

    def _sweeps(self) -> bool:
        """Whether a step may ask for the sweeps of shapes."""
        return self._state.sweeps_ready or self._bounces or self._scene.sweeps_asked

    def _parts_by_address(self) -> dict[int, Linked]:
        """The parts of stages that are called by address, only where there may be something for them to do."""
        state, collides = self._state, self._state.collides
        places = needed_places(
            state.dimensions, state.sweeps_ready, collides and self._bounces, collides and self._turns, self._joined[0]
        )
        return {place: linked_part(place, LINKED_PARTS[place], state.dimensions) for place in places}

    def link_shapes(self) -> None:
        """The functions of the shapes alone, where they are not linked yet."""
        sweeps = self._sweeps()
        key = self._scene.linked, sweeps, self._scene.moments_asked
        if key != self._shapes_key:
            link_all(self._functions_of_shapes())
            self._scene.link_shapes(sweeps)
            self._shapes_key = key

    def link_impacts(self) -> None:
        """What impacts need, where nothing could bounce when the stages were linked."""
        self._bounces = True
        self._link_within_step()

    def link_together(self) -> None:
        """What impacts at the same time need."""
        part = linked_part(TAKE_TOGETHER, LINKED_PARTS[TAKE_TOGETHER], self._state.dimensions)
        self._state.links[TAKE_TOGETHER] = part.address

    def link_rest(self) -> None:
        """What contacts at rest need, where none was expected."""
        self._rests = True
        self._link_within_step()

    def _link_within_step(self) -> None:
        """Link what is needed now; the next step begins as after any other change."""
        self._link_stages(self._conditions())
        self.link_shapes()
        self.version = NEVER_LINKED

    def _link_possible(self) -> None:
        """All that this world can need, when that may be more than before."""
        key = (self._scene.linked, self._scene.registry.version, self._integration.stages_possible)
        if key != self._kept_key:
            link_possible(*kind_of_world(self._scene, self._integration, self._program))
            self._kept_key = key
