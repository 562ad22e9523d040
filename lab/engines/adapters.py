"""carom and pymunk behind one interface, so that both are measured in the same way."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from ...components.spin import Spin
from ...framework import World
from ..measure.body_shapes import Enclosure, Floats, moving_rows, overlaps_of, sensor_entities, sizes_of
from ..measure.timing import timed
from ..trading.records import PYMUNK
from .pymunk_space import PymunkSpace

MOST_TOUCHES = 400  # pairs whose first contact is kept


class Engine(ABC):
    """A running scene. Bodies are the dynamic ones there are, ascending by entity id, which is the order of creation.

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

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self.world.time

    @abstractmethod
    def step(self, dt: float) -> None:
        """One step of ``dt`` seconds."""

    def _timed(self, step: Callable[[], Any], dt: float) -> None:
        seconds, valid, _ = timed(step)
        if valid:
            self.spent += seconds
            self.timed_seconds += dt

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

    @abstractmethod
    def overlaps(self) -> Floats:
        """(k,) depths of the overlapping pairs, in sizes of the smaller body."""

    @cached_property
    def sizes(self) -> dict[int, float]:
        """The smallest extent of each entity that has a built-in shape."""
        return sizes_of(self.world)

    @cached_property
    def size(self) -> float:
        """The smallest extent of the dynamic bodies; without shapes the largest coordinate, else 1."""
        known = [self.sizes[e] for e in self.ids.tolist() if e in self.sizes]
        return min(known, default=0.0) or float(np.abs(self.position).max(initial=0.0)) or 1.0

    @abstractmethod
    def counts(self) -> dict[str, float]:
        """Machine-independent counts since the start."""

    def close(self) -> None:
        """Close the world."""
        self.world.close()


class CaromEngine(Engine):
    """A world of carom."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._bodies = np.array(world.bodies.entity)
        self._sensors = sensor_entities(world)  # all that there were: what is touched may be deleted

    def step(self, dt: float) -> None:
        world = self.world
        if world.settings.dt != dt:
            world.settings = world.settings.replace(dt=dt)
        before = world.time
        self._timed(world.step, dt)
        self.take_in(before)

    def take_in(self, before: float) -> None:
        """What the world's last step has done, which began at that time."""
        self.follow()
        if not np.array_equal(self._bodies, bodies := self.world.bodies.entity):
            self._bodies = np.array(bodies)
            self._sensors = np.union1d(self._sensors, sensor_entities(self.world))
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
        return ~(np.isin(contacts.entity_a, self._sensors) | np.isin(contacts.entity_b, self._sensors))

    def deep(self) -> np.ndarray:
        """True for the contacts in which solid bodies overlap."""
        contacts = self.world.contacts
        moves = np.isin(contacts.entity_a, self.ids) | np.isin(contacts.entity_b, self.ids)  # platforms pass walls
        return (contacts.depth > 0) & moves & self._solid()

    def overlaps(self) -> Floats:
        contacts, sizes, deep = self.world.contacts, self.sizes, self.deep()
        pairs = zip(contacts.entity_a[deep].tolist(), contacts.entity_b[deep].tolist(), strict=True)
        smaller = [min(sizes.get(a, math.inf), sizes.get(b, math.inf)) for a, b in pairs]
        return np.asarray(contacts.depth)[deep] / np.array(smaller, float)

    def counts(self) -> dict[str, float]:
        return counts_of(self.world)


class PymunkEngine(Engine):
    """pymunk on the bodies of a world of carom. The world is kept in sync; it sums the forces and the energies.

    Force systems follow pymunk's manual: their force is applied to each body before the step. substeps: iterations of
    the solver. NotPlainError for scenes that cannot be translated.
    """

    def __init__(self, world: World, iterations: int) -> None:
        super().__init__(world)
        self.space = PymunkSpace(world)
        self.space.space.iterations = iterations
        self._iterations = iterations
        physics: Any = world.physics
        physics.refresh_for_queries()  # the forces are summed without a step of carom
        self._sums = physics.forces
        self._time, self._steps, self._forces, self._pairs = 0.0, 0, 0, 0
        self._dt = 0.0
        self._impacts = 0
        handler = self.space.space
        bodies = {body: row for row, body in enumerate(self.space.bodies)}
        handler.on_collision(None, None, begin=self._begin, post_solve=self._solved, data=bodies)

    @property
    def time(self) -> float:
        return self._time

    def _begin(self, arbiter: Any, space: Any, bodies: dict[Any, int]) -> None:
        del space
        self._impacts += 1
        self.times.append(self._time + self._dt)
        for body in arbiter.bodies:
            if body in bodies:
                self.struck[bodies[body]] = True

    def _solved(self, arbiter: Any, space: Any, bodies: dict[Any, int]) -> None:
        del space
        self._pairs += 1
        if not all(body in bodies for body in arbiter.bodies):
            self.impulse += arbiter.total_impulse.length

    def step(self, dt: float) -> None:
        self.impulse, self.times, self._dt = 0.0, [], dt
        if self.world.force_systems:
            self._push()
        self.space.dt = dt
        self._timed(lambda: self.space.step(1), dt)
        self._time += dt
        self._steps += 1
        self._mirror()

    def overlaps(self) -> Floats:
        self.world.refresh_queries()
        return overlaps_of(self.world)[2]

    def _push(self) -> None:
        """Apply the forces of the force systems at this state for one step; pymunk applies gravity itself."""
        self._forces += 1
        self._sums.evaluate(self._time)
        dynamic = self.world.bodies.dynamic
        weight = (dynamic.mass * dynamic.gravity_scale)[:, None] * np.asarray(self.world.gravity)
        force = (np.array(dynamic.force) - weight)[self._order]
        for body, (x, y) in zip(self.space.bodies, force.tolist(), strict=True):
            body.apply_force_at_world_point((x, y), body.position)

    def _mirror(self) -> None:
        position, velocity = self.space.state()
        dynamic = self.world.bodies.dynamic
        dynamic.position[self._order] = position
        dynamic.linear_velocity[self._order] = velocity
        if self.world.bodies.has(Spin).any():
            rows = moving_rows(self.world)
            self.world.bodies.rotation[rows], self.world.bodies.spin.angular_velocity[rows] = self.space.turns()

    def counts(self) -> dict[str, float]:
        return {
            "steps": float(self._steps),
            "force_evaluations": float(max(self._forces, self._steps)),
            "body_steps": float(self._steps * len(self.ids)),
            "pairs": float(self._pairs),
            "impacts": float(self._impacts),
            "solver_loops": float(self._pairs * self._iterations),
        }


def carried(values: Any, old: Any, new: Any, start: Any) -> Any:
    """``start`` (n, ...) for the ids ``new``, with the ``values`` of those that were among ``old``; both ascending."""
    _, mine, theirs = np.intersect1d(new, old, assume_unique=True, return_indices=True)
    start[mine] = values[theirs]
    return start


def engine_for(world: World, engine: str, iterations: int) -> Engine:
    """The engine of that name on ``world``, which it will close; iterations: of pymunk's solver."""
    return PymunkEngine(world, iterations) if engine == PYMUNK else CaromEngine(world)


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
