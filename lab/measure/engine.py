"""A running world as measurements see it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from ...framework import World
from .body_shapes import Enclosure, Floats, sensor_entities, sizes_of
from .timing import timed

MOST_TOUCHES = 400  # pairs whose first contact is kept


class CaromEngine:
    """A running world. Bodies are the dynamic ones there are, ascending by entity id, which is the order of creation.

    After a step: ``impulse`` N s on static bodies, ``times`` s of the impacts of the step, ``struck`` (n,) true for
    bodies that have had an impact or a contact since the start. ``spent`` s on the clock of ``measure.timing`` for
    ``timed_seconds`` simulated ones: steps that neither compiled nor loaded kernels. ``created``: bodies that came
    since the start; ``fixed``: none came or went. ``touches``: pairs of entities and the time of their first contact,
    in this order; ``met``: one was of solid bodies.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self._rows_then = np.array(world.bodies.dynamic.entity)
        self._order = np.argsort(self._rows_then, kind="stable")
        self.ids = self._rows_then[self._order]
        self.created, self.fixed, self.met = 0, True, False
        self.touches: dict[tuple[int, int], float] = {}
        self.enclosure = Enclosure.around(world)
        self.impulse = 0.0
        self.times: list[float] = []
        self.struck = np.zeros(len(self.ids), bool)
        self.spent = self.timed_seconds = 0.0
        self._bodies = np.array(world.bodies.entity)
        self._sensors = [sensor_entities(world)]  # and those before the last change: what is touched may be deleted

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self.world.time

    def step(self, dt: float) -> None:
        """One step of ``dt`` seconds."""
        world = self.world
        if world.settings.dt != dt:
            world.settings = world.settings.replace(dt=dt)
        before = world.time
        seconds, valid, _ = timed(world.step)
        if valid:
            self.spent += seconds
            self.timed_seconds += dt
        self.take_in(before)

    def follow(self) -> None:
        """Take up which bodies there are now."""
        rows = np.asarray(self.world.bodies.dynamic.entity)
        if len(rows) == len(self._rows_then) and (rows == self._rows_then).all():
            return
        self._rows_then = rows.copy()
        self._order = np.argsort(rows, kind="stable")
        ids = rows[self._order]
        if len(ids) != len(self.ids) or (ids != self.ids).any():
            self.fixed = False
            self.created += len(np.setdiff1d(ids, self.ids, assume_unique=True))
            self.struck = carried(self.struck, self.ids, ids, np.zeros(len(ids), bool))
            self.ids = ids

    @property
    def position(self) -> Floats:
        """A copy, (n, d)."""
        self.follow()
        return np.array(self.world.bodies.dynamic.position)[self._order]

    @property
    def velocity(self) -> Floats:
        """A copy, (n, d), of the bodies whose position was last read."""
        return np.array(self.world.bodies.dynamic.linear_velocity)[self._order]

    @property
    def energies(self) -> tuple[float, float]:
        """Kinetic energy, and with the potential energy, J; without force systems that do not report theirs."""
        kinetic = self.world.kinetic_energy()
        return kinetic, kinetic + self.world.potential_energy()

    @cached_property
    def sizes(self) -> dict[int, float]:
        """The smallest extent of each entity that has a built-in shape."""
        return sizes_of(self.world)

    @cached_property
    def size(self) -> float:
        """The smallest extent of the dynamic bodies; without shapes the largest coordinate, else 1."""
        known = [self.sizes[e] for e in self.ids.tolist() if e in self.sizes]
        return min(known, default=0.0) or float(np.abs(self.position).max(initial=0.0)) or 1.0

    def close(self) -> None:
        """Close the world."""
        self.world.close()

    def take_in(self, before: float) -> None:
        """What the world's last step has done, which began at that time."""
        self.follow()
        if not np.array_equal(self._bodies, bodies := self.world.bodies.entity):
            self._bodies = np.array(bodies)
            self._sensors = [sensor_entities(self.world), self._sensors[0]]
        contacts = self.world.contacts
        self._note_touches(before)
        self.impulse, self.times = 0.0, []
        if len(contacts):
            a, b = self._rows(contacts.entity_a), self._rows(contacts.entity_b)
            solid = self._solid()
            self.met |= bool(solid.any())
            self.struck[a[(a >= 0) & solid]] = True
            self.struck[b[(b >= 0) & solid]] = True
            self.impulse = float(contacts.normal_impulse[(a < 0) | (b < 0)].sum())
        impacts = contacts.impacts
        if len(impacts):
            self.times = (before + np.sort(impacts.time_of_impact)).tolist()

    def _note_touches(self, before: float) -> None:
        """Keep which pairs have touched for the first time, and when."""
        contacts = self.world.contacts
        if not len(contacts.begin) and not len(contacts.impacts):
            return
        if len(self.touches) >= MOST_TOUCHES:
            return
        impacts, begin = contacts.impacts, contacts.begin
        times = (before + np.asarray(impacts.time_of_impact)).tolist()
        found = list(zip(times, impacts.entity_a.tolist(), impacts.entity_b.tolist(), strict=True))
        found += [(self.time, a, b) for a, b in zip(begin.entity_a.tolist(), begin.entity_b.tolist(), strict=True)]
        for time, a, b in sorted(found):
            self.touches.setdefault((min(a, b), max(a, b)), time)

    def _rows(self, entities: Any) -> np.ndarray:
        """The rows of the entities in the body arrays; -1 for static bodies."""
        if not len(self.ids):
            return np.full(len(entities), -1)
        places = np.searchsorted(self.ids, entities)
        places[places == len(self.ids)] = 0
        return np.where(self.ids[places] == entities, places, -1)

    def _solid(self) -> np.ndarray:
        """True for contacts without a sensor."""
        contacts = self.world.contacts
        sensors = np.concatenate(self._sensors)
        return ~(np.isin(contacts.entity_a, sensors) | np.isin(contacts.entity_b, sensors))

    def deep(self) -> np.ndarray:
        """True for the contacts in which solid bodies overlap."""
        contacts = self.world.contacts
        moves = np.isin(contacts.entity_a, self.ids) | np.isin(contacts.entity_b, self.ids)  # platforms pass walls
        return (contacts.depth > 0) & moves & self._solid()

    def overlaps(self) -> Floats:
        """(k,) depths of the overlapping pairs, in sizes of the smaller body."""
        contacts, sizes, deep = self.world.contacts, self.sizes, self.deep()
        pairs = zip(contacts.entity_a[deep].tolist(), contacts.entity_b[deep].tolist(), strict=True)
        smaller = [min(sizes.get(a, math.inf), sizes.get(b, math.inf)) for a, b in pairs]
        return np.asarray(contacts.depth)[deep] / np.array(smaller, float)

    def counts(self) -> dict[str, float]:
        """Machine-independent counts since the start."""
        return counts_of(self.world)


def carried(values: Any, old: Any, new: Any, start: Any) -> Any:
    """``start`` (n, ...) for the ids ``new``, with the ``values`` of those that were among ``old``; both ascending."""
    _, mine, theirs = np.intersect1d(new, old, assume_unique=True, return_indices=True)
    start[mine] = values[theirs]
    return start


# -- cost ------------------------------------------------------------------------------------------------


# ns each. A step runs Python code between kernels; an evaluation of forces calls each force system once.
WEIGHTS: Mapping[str, float] = {
    "steps": 50_000.0,
    "force_evaluations": 10_000.0,
    "body_steps": 10.0,
    "candidates": 5.0,
    "pairs": 10.0,
    "impacts": 1_000.0,
    "rounds": 50_000.0,
    "solver_loops": 4.0,
}


def counts_of(world: World) -> dict[str, float]:
    """The counts of a world since its creation, with the same substeps throughout.

    steps, force_evaluations (sums over all bodies), body_steps, candidates of the broad phase, pairs tested, impacts,
    rounds: how often candidates were searched again within a step.
    """
    counters = world.stats().counters
    return {
        "steps": float(world.step_count),
        "force_evaluations": float(counters.get("force_evaluations", 0)),
        "body_steps": float(counters.get("bodies", 0)),
        "candidates": float(counters.get("candidates", 0)),
        "pairs": float(counters.get("pairs", 0)),
        "impacts": float(counters.get("impacts", 0)),
        "rounds": float(counters.get("rounds", 0)),
        "solver_loops": float(counters.get("resting_contacts", 0) * world.settings.substeps),
    }


def work_of(counts: Mapping[str, float]) -> float:
    """The weighted sum of counts; per simulated second if the counts are."""
    return sum(WEIGHTS[name] * count for name, count in counts.items() if name in WEIGHTS)
