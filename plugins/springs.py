"""Springs between two bodies: damped springs, ropes that only pull, stiff springs that keep a distance.

    springs = Springs()
    world = World(Physics(), springs)
    spring = springs.connect(a, b, stiffness=50.0, damping=0.5)
"""

from __future__ import annotations

import itertools
import math
import numbers
from collections.abc import Iterator
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from ..components import Transform
from ..framework import Bodies, CaromError, ForceSystem, Phase, Plugin, System, World
from ..framework.vectors import length

__all__ = ["Spring", "Springs"]

FIELDS = ("rest_length", "stiffness", "damping", "only_pulls")
STABLE = 2.0  # above it no explicit integrator holds a spring, see Springs


class Spring:
    """A spring between two bodies, made by :meth:`Springs.connect`; its fields can be set at any time.

    a, b
        the entities
    rest_length
        m, at least 0: the distance without force
    stiffness
        N/m, at least 0
    damping
        N s/m, at least 0: force per speed of separation or approach
    only_pulls
        a rope: slack below its rest length, never pushes
    """

    __slots__ = ("__weakref__", "_number", "_springs", "a", "b", *FIELDS)

    a: int
    b: int
    rest_length: float
    stiffness: float
    damping: float
    only_pulls: bool

    def __init__(self, springs: Springs, number: int, *values: Any) -> None:
        self._number = number  # in its Springs, which never gives a number twice
        for name, value in zip(("a", "b", *FIELDS), values, strict=True):
            setattr(self, name, value)
        self._springs: Springs = springs

    def __setattr__(self, name: str, value: Any) -> None:
        made = hasattr(self, "_springs")
        if name in FIELDS:
            value = _checked(name, value)
        elif made:
            raise AttributeError(f"Spring.{name} cannot be set")
        super().__setattr__(name, value)
        if made:
            self._springs._columns = None

    @property
    def connected(self) -> bool:
        """True while it acts: not removed, and both bodies exist."""
        return self in self._springs

    @property
    def length(self) -> float:
        """m, the present distance of the two bodies. CaromError if it is no longer connected."""
        return self._springs._now(self)[0]

    @property
    def tension(self) -> float:
        """N, the present attractive force; negative: it pushes. CaromError if it is no longer connected."""
        return self._springs._now(self)[1]

    def remove(self) -> None:
        """Remove the spring. Removing it twice has no effect."""
        self._springs._springs.pop(self, None)
        self._springs._columns = None

    def __repr__(self) -> str:
        return f"Spring({self.a}, {self.b}, {', '.join(f'{name}={getattr(self, name)!r}' for name in FIELDS)})"


class Springs(Plugin):
    """The springs of one world: ``World(Physics(), springs)``, then ``springs.connect(a, b, stiffness=...)``.

    A step dt holds springs whose :attr:`highest_frequency` w satisfies dt w < 2 (semi-implicit Euler and velocity
    Verlet; somewhat less with damping). If springs are too stiff for the step, ``world.faults`` says so.

    When a body is deleted, its springs are removed at the start of the next step, and the event ``spring_lost`` is sent
    for each. Springs are part of a snapshot: a spring that has been removed since is connected again when it is
    restored, the same object if anything still has it.
    """

    def __init__(self) -> None:
        super().__init__("springs", version="1.0", needs_physics=True)
        self.event("spring_lost")
        self.world: World | None = None
        self._springs: dict[Spring, None] = {}
        self._columns: _Columns | None = None  # of the present springs
        self._numbers = itertools.count(1)
        self._by_number: WeakValueDictionary[int, Spring] = WeakValueDictionary()  # removed ones too
        for kind in (SpringForces, LostSprings):
            self.system(lambda kind=kind: kind(self))

    def install(self, world: World) -> None:
        """Called by the world; ValueError if these springs are in another one that is not closed."""
        if self.world is not None and not self.world.closed:
            raise ValueError(f"these springs belong to world {self.world.name!r}: each world takes its own Springs()")
        super().install(world)
        self.world = world
        self.clear()

    def connect(
        self, a: int, b: int, rest_length: float | None = None, *, stiffness: float, damping: float = 0.0,
        only_pulls: bool = False,
    ) -> Spring:  # fmt: skip
        """Connect two bodies with a spring; see :class:`Spring`. It acts from the next evaluation of forces on.

        rest_length
            m; None: the present distance of the two
        stiffness, damping, only_pulls
            fields of the spring

        ValueError if an entity is not a body, if both are the same, or if a number is out of range.
        """
        places = [self._place(name, entity) for name, entity in (("a", a), ("b", b))]
        if a == b:
            raise ValueError(f"springs.connect: a spring needs two bodies, got entity {a} twice")
        rest = length(tuple((places[1] - places[0]).tolist())) if rest_length is None else rest_length
        number = next(n for n in self._numbers if n not in self._by_number)
        return self._add(Spring(self, number, int(a), int(b), rest, stiffness, damping, only_pulls))

    def of(self, entity: int) -> list[Spring]:
        """The springs at that entity, in order of their creation."""
        return [spring for spring in self._springs if entity in (spring.a, spring.b)]

    def clear(self) -> None:
        """Remove all springs."""
        self._springs.clear()
        self._columns = None

    @property
    def highest_frequency(self) -> float:
        """rad/s, an upper bound of the oscillation frequencies of the bodies; exact for a single spring.

        With D the sum of stiffnesses at a body and m its mass: the largest D/m + D'/m' of two connected bodies
        (Gershgorin's circles of the springs' matrix). A step dt holds them if dt times this is below 2.
        """
        bodies = self._bodies()
        columns = self._current(bodies)
        return math.sqrt(columns.rate(bodies, columns.stiffness))

    # -- snapshots --------------------------------------------------------------------------------

    def saved(self, world: World) -> Any:
        """(n, 7) number, a, b and the fields of all springs, in order of their creation."""
        return [[s._number, s.a, s.b, *(getattr(s, name) for name in FIELDS)] for s in self._springs]

    def take_back(self, world: World, saved: Any) -> None:
        """Connect these springs and no others."""
        self.clear()
        for number, a, b, *fields in saved:
            spring = self._by_number.get(number)
            if spring is None or (spring.a, spring.b) != (a, b):
                spring = Spring(self, number, a, b, *fields)
            for name, value in zip(FIELDS, fields, strict=True):
                setattr(spring, name, value)
            self._add(spring)

    def __len__(self) -> int:
        return len(self._springs)

    def __iter__(self) -> Iterator[Spring]:
        return iter(list(self._springs))

    def __contains__(self, spring: object) -> bool:
        return spring in self._springs

    # -- for springs and systems ------------------------------------------------------------------

    def _bodies(self) -> Bodies:
        if self.world is None:
            raise CaromError("these springs are in no world yet: World(Physics(...), springs)")
        return self.world.bodies

    def _place(self, name: str, entity: int) -> np.ndarray:
        """(d,) m: where a body is, also one that the world has taken in since the last step."""
        self._bodies()
        world: Any = self.world
        try:
            own = {type(component): component for component in world.components_for_entity(entity)}
        except (KeyError, TypeError):
            own = {}
        if Transform not in own or not any(getattr(kind, "makes_body", False) for kind in own):
            raise ValueError(
                f"springs.connect: {name} must be the entity of a body (Transform and RigidBody or a collider) in "
                f"world {world.name!r}, got {entity!r}"
            )
        return np.array(own[Transform].position)

    def _add(self, spring: Spring) -> Spring:
        self._by_number[spring._number], self._springs[spring], self._columns = spring, None, None
        return spring

    def _current(self, bodies: Bodies) -> _Columns:
        """The springs' columns, rebuilt if springs or rows have changed."""
        if self._columns is None or not np.array_equal(self._columns.entity, bodies.entity):
            self._columns = _Columns(list(self._springs), bodies)
        return self._columns

    def _now(self, spring: Spring) -> tuple[float, float]:
        if spring not in self:
            raise CaromError(f"{spring!r} is not connected any more")
        length, _, tension = _Columns([spring], self._bodies()).tension(self._bodies())
        return float(length[0]), float(tension[0])


class _Columns:
    """Springs as arrays, sorted by lower id, higher id, then fields, independent of the order of creation."""

    def __init__(self, springs: list[Spring], bodies: Bodies) -> None:
        self.entity = bodies.entity.copy()
        ends = np.array([sorted((s.a, s.b)) for s in springs], np.int64).reshape(-1, 2)
        fields = np.array([(s.rest_length, s.stiffness, s.damping, s.only_pulls) for s in springs]).reshape(-1, 4)
        known = np.append(self.entity, np.iinfo(np.int64).max)  # what is sought is never behind the last
        order = np.argsort(known, kind="stable")
        rows = order[np.searchsorted(known, ends, sorter=order)]
        here = (known[rows] == ends).all(axis=1)
        self.missing = [spring for spring, found in zip(springs, here, strict=True) if not found]
        ranking = np.lexsort((*fields.T[::-1], ends[:, 1], ends[:, 0]))
        ranking = ranking[here[ranking]]
        self.low, self.high = rows[ranking].T
        self.rest_length, self.stiffness, self.damping, pulls = fields[ranking].T
        self.only_pulls = pulls.astype(bool)

    def tension(self, bodies: Bodies) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(length (n,), unit vector (n, d) from the lower to the higher id, attractive force (n,))."""
        position, velocity = bodies.position, bodies.linear_velocity
        apart = position[self.high] - position[self.low]
        largest = np.abs(apart).max(axis=1)
        unit = np.divide(apart, largest[:, None], out=np.zeros_like(apart), where=largest[:, None] > 0)
        length = largest * np.sqrt((unit * unit).sum(axis=1))  # no square overflows
        unit = np.divide(apart, length[:, None], out=np.zeros_like(apart), where=length[:, None] > 0)
        speed = ((velocity[self.high] - velocity[self.low]) * unit).sum(axis=1)
        tension = self.stiffness * (length - self.rest_length) + self.damping * speed
        slack = self.only_pulls & ((length <= self.rest_length) | (tension < 0))
        return length, unit, np.where(slack, 0.0, tension)

    def summed(self, weights: np.ndarray, others: np.ndarray, count: int) -> np.ndarray:
        """(count,) the weights at the lower ids and the others at the higher ones, in the order of the columns."""
        return np.bincount(np.concatenate((self.low, self.high)), np.concatenate((weights, others)), count)

    def rate(self, bodies: Bodies, weights: np.ndarray) -> float:
        """The largest rate, 1/s^2 of stiffness or 1/s of damping: for each spring the sums of all springs at both of
        its bodies, each divided by the body's mass, are added. Immovable bodies count as infinitely heavy."""
        inverse_mass = np.zeros(len(bodies))
        inverse_mass[bodies.dynamic.rows] = 1.0 / bodies.dynamic.mass
        at = self.summed(weights, weights, len(bodies)) * inverse_mass
        return float((at[self.low] + at[self.high]).max(initial=0.0))


class SpringForces(ForceSystem):
    """The forces of all springs."""

    def __init__(self, springs: Springs) -> None:
        self._springs = springs

    def add_forces(self, bodies: Any, time: float) -> None:
        if len(self._springs):
            everything = self.world.bodies
            columns = self._springs._current(everything)
            _, unit, tension = columns.tension(everything)
            pull = (tension[:, None] * unit).T
            forces = np.stack([columns.summed(part, -part, len(everything)) for part in pull], axis=1)
            bodies.force += forces[everything.dynamic.rows]

    def potential_energy(self, bodies: Any) -> float:
        """Joules: half stiffness times stretch squared, summed in the springs' own order."""
        columns = self._springs._current(self.world.bodies)
        stretch = columns.tension(self.world.bodies)[0] - columns.rest_length
        stretch = np.where(columns.only_pulls, np.maximum(stretch, 0.0), stretch)
        return float((0.5 * columns.stiffness * stretch * stretch).sum())


class LostSprings(System):
    """Removes the springs of deleted bodies and reports them; checks that the step holds the others."""

    phase = Phase.START

    def __init__(self, springs: Springs) -> None:
        self._springs = springs
        self._looked_at: tuple[Any, float] = (None, 0.0)

    def process(self, dt: float) -> None:
        bodies = self.world.bodies
        columns = self._springs._current(bodies)
        for spring in columns.missing:
            spring.remove()
            self.world.dispatch_event("spring_lost", spring)
        if self._looked_at == (columns, dt):
            return
        self._looked_at = (columns, dt)
        stiff, damped = columns.rate(bodies, columns.stiffness), columns.rate(bodies, columns.damping)
        if dt * dt * stiff + 2 * dt * damped >= STABLE**2:  # semi-implicit Euler is unstable
            longest = 4.0 / (damped + math.sqrt(damped * damped + 4.0 * stiff))
            self.world.report_fault(
                f"springs: dt = {dt:.3g} s is too long for springs this stiff on bodies this light (highest frequency "
                f"{math.sqrt(stiff):.4g} rad/s, damping rate {damped:.4g} /s); they hold up to dt = {longest:.3g} s: "
                f"use smaller steps, softer springs or heavier bodies",
                kind="springs",
            )

    def reason(self) -> str:
        return f"{len(self._springs)} springs: removes those whose bodies are gone"


def _checked(name: str, value: Any) -> Any:
    """A field as it is kept; ValueError for what it cannot be."""
    truth = isinstance(value, (bool, np.bool_))
    if name == "only_pulls":
        if not truth:
            raise ValueError(f"Spring.only_pulls must be True or False, got {value!r}")
        return bool(value)
    if truth or not isinstance(value, numbers.Real) or not (math.isfinite(value) and float(value) >= 0):
        raise ValueError(f"Spring.{name} must be a finite number of at least 0, got {value!r}")
    return float(value)
