"""NARROW: which candidates touch at the end of their motion, and how."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...framework.data.bodies import Bodies
from ...framework.errors import PluginError
from ...framework.plugins.registry import Registry
from ...framework.schedule.phases import Phase
from ...framework.schedule.stages import Program, PythonPart, Stage
from ..ccd.search_bounds import sweep_pairs
from ..scene import Scene
from ..sleeping.stages import find_touched, measure_force_changes
from ..stage_system import StagedSystem
from .one_way import release_one_way
from .stages import (
    ROOM_FOR_ORDER,
    ROOM_FOR_PAIRS,
    collect_contacts,
    evaluate_levels,
    evaluate_pairs,
    order_candidates,
    select_pairs,
)


class NarrowPhase(StagedSystem):
    """Tests the candidates with the functions of their shapes, level by level, and fills ``world.contacts``.

    Reads position and the colliders; writes the contacts, with ``enabled`` set. Systems that run after it and before
    RESPONSE may clear ``enabled``.
    """

    phase = Phase.NARROW
    STAGES = (
        Stage(
            order_candidates, "canonical order of the candidates, by entity id", ("candidates",), ("candidates",),
            "colliders", room=ROOM_FOR_ORDER,
        ),
        Stage(
            select_pairs, "layers, masks and groups", ("candidates", "layer", "mask", "group"), ("pairs",), "colliders",
            room=ROOM_FOR_PAIRS,
        ),
        Stage(
            measure_force_changes, "what forces would do to sleepers", ("sleep_state", "flown_velocity"),
            ("force_speed_change",),
            "sleeping", "bodies sleep",
        ),
        Stage(evaluate_pairs, "the shapes' functions", ("pairs", "position"), ("pairs",), "one level"),
        Stage(
            evaluate_levels, "the shapes' functions, level by level", ("pairs", "position"), ("pairs",),
            "several levels",
        ),
        Stage(collect_contacts, "which pairs touch or nearly do", ("pairs",), ("pairs",), "contacts"),
        Stage(
            sweep_pairs, "which pairs touch on their paths only", ("pairs", "path_velocity"), ("pairs",),
            "swept bodies", "pairs are near each other",
        ),
        Stage(
            release_one_way, "which pairs meet the front of what is solid from one side", ("pairs", "one_way"),
            ("pairs",), "one-way colliders", "pairs are near each other",
        ),
        Stage(
            find_touched, "wakes what an awake body touches", ("pairs", "sleep_state"), ("sleep_state",), "sleeping",
            "bodies sleep",
        ),
    )  # fmt: skip

    def __init__(self, program: Program, scene: Scene, registry: Registry, bodies: Bodies) -> None:
        super().__init__(program)
        self._state, self._scene, self._registry, self._bodies = program.state, scene, registry, bodies

    def _parts(self) -> list[Any]:
        self._state.pairs_filtered = bool(self._registry.pair_filters)
        if not self._registry.pair_filters:
            return [self.segment()]
        return [
            self.segment(last="order_candidates"),
            PythonPart(self.name, lambda dt: self.filter_candidates()),
            self.segment("select_pairs"),
        ]

    def filter_candidates(self) -> None:
        """Keep the candidates that every plugin's filter lets through; PluginError if one does not say which."""
        candidates = self._state.candidates
        count = candidates.count
        first, second = candidates.sorted_a[:count], candidates.sorted_b[:count]
        for plugin, function in self._registry.pair_filters:
            if not len(first):
                break
            name = f"plugin {plugin}: pair filter {function.__name__}"
            try:
                may_meet = function(self._bodies, first, second)
            except Exception as error:
                error.add_note(name)
                raise
            if not isinstance(may_meet, np.ndarray) or may_meet.dtype != bool or may_meet.shape != first.shape:
                got = f"{may_meet.dtype} {may_meet.shape}" if isinstance(may_meet, np.ndarray) else repr(may_meet)
                raise PluginError(f"{name} must return an array of {len(first)} bool, one for each pair, got {got}")
            first, second = first[may_meet], second[may_meet]
        candidates.count = len(first)
        candidates.sorted_a[: len(first)], candidates.sorted_b[: len(first)] = first, second

    def reason(self) -> str:
        if not self._state.collides or self._scene.linked is None:
            return "no colliders: nothing to do"
        names = ", ".join(shape.component.__name__ for shape in self._scene.linked.shapes)
        levels = "; bodies with several colliders: level by level, the cheap one first"
        return f"all pairs of {names}" + (levels if self._state.several_levels else "")
