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

from ..framework import Bodies, CaromError, ForceSystem, NoPhysicsError, Phase, Plugin, System, World

# Above it no explicit integrator holds a spring, see Springs.
STABLE = 2.0


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

    __slots__ = (
        "__weakref__", "_a", "_b", "_damping", "_number", "_only_pulls", "_rest_length", "_springs", "_stiffness",
    )  # fmt: skip

    def __init__(
        self, springs: Springs, a: int, b: int, rest_length: float, stiffness: float, damping: float, only_pulls: bool
    ) -> None:
        self._springs: Springs | None = None
        self._a, self._b = a, b
        self._number = 0  # in its Springs, which never gives a number twice
        self.rest_length = rest_length
        self.stiffness = stiffness
        self.damping = damping
        self.only_pulls = only_pulls
        self._springs = springs

    @property
    def a(self) -> int:
        return self._a

    @property
    def b(self) -> int:
        return self._b

    @property
    def rest_length(self) -> float:
        return self._rest_length

    @rest_length.setter
    def rest_length(self, value: float) -> None:
        self._set("_rest_length", _number("rest_length", value))

    @property
    def stiffness(self) -> float:
        return self._stiffness

    @stiffness.setter
    def stiffness(self, value: float) -> None:
        self._set("_stiffness", _number("stiffness", value))

    @property
    def damping(self) -> float:
        return self._damping

    @damping.setter
    def damping(self, value: float) -> None:
        self._set("_damping", _number("damping", value))

    @property
    def only_pulls(self) -> bool:
        return self._only_pulls

    @only_pulls.setter
    def only_pulls(self, value: bool) -> None:
        if not isinstance(value, (bool, np.bool_)):
            raise ValueError(f"Spring.only_pulls must be True or False, got {value!r}")
        self._set("_only_pulls", bool(value))

    @property
    def connected(self) -> bool:
        """True while it acts: not removed, and both bodies exist."""
        return self._springs is not None and self in self._springs

    @property
    def length(self) -> float:
        """m, the present distance of the two bodies. CaromError if it is no longer connected."""
        return self._now()[0]

    @property
    def tension(self) -> float:
        """N, the present attractive force; negative: it pushes. CaromError if it is no longer connected."""
        return self._now()[1]

    def remove(self) -> None:
        """Remove the spring. Removing it twice has no effect."""
        if self._springs is not None:
            self._springs._remove(self)

    def _now(self) -> tuple[float, float]:
        if self._springs is None or not self.connected:
            raise CaromError(f"{self!r} is not connected any more")
        return self._springs._now(self)

    def _set(self, name: str, value: Any) -> None:
        setattr(self, name, value)
        if self._springs is not None:
            self._springs._changed()

    def __repr__(self) -> str:
        return (
            f"Spring({self._a}, {self._b}, rest_length={self.rest_length!r}, stiffness={self.stiffness!r}, "
            f"damping={self.damping!r}, only_pulls={self.only_pulls!r})"
        )


class Springs(Plugin):
    """The springs of one world: ``World(Physics(), springs)``, then ``springs.connect(a, b, stiffness=...)``.

    A step dt holds springs whose :attr:`highest_frequency` w satisfies dt w < 2 (semi-implicit Euler and velocity
    Verlet; somewhat less with damping). If springs are too stiff for the step, ``world.faults`` says so.

    When a body is deleted, its springs are removed at the start of the next step, and the event ``spring_lost`` is sent
    for each. Springs are part of a snapshot: a spring that has been removed since is connected again when it is
    restored, the same object if anything still has it.
    """

    def __init__(self) -> None:
        super().__init__("springs", version="1.0")
        self.world: World | None = None
        self._springs: dict[Spring, None] = {}
        self._columns: _Columns | None = None  # of the present springs
        self._numbers = itertools.count(1)
        self._by_number: WeakValueDictionary[int, Spring] = WeakValueDictionary()  # removed ones too

        def spring_forces() -> ForceSystem:
            return SpringForces(self)

        def lost_springs() -> System:
            return LostSprings(self)

        self.system(spring_forces)
        self.system(lost_springs)

    def install(self, world: World) -> None:
        if world.physics is None:
            raise NoPhysicsError("springs need physics before them: World(Physics(...), springs)")
        if self.world is not None and not self.world.closed:
            raise ValueError(f"these springs belong to world {self.world.name!r}: each world takes its own Springs()")
        self.world = world
        world.events.define("spring_lost")
        self._springs.clear()
        self._changed()
        super().install(world)

    def connect(
        self,
        a: int,
        b: int,
        rest_length: float | None = None,
        *,
        stiffness: float,
        damping: float = 0.0,
        only_pulls: bool = False,
    ) -> Spring:
        """Connect two bodies with a spring; see :class:`Spring`. It acts from the next evaluation of forces on.

        rest_length
            None: the present distance of the two

        ValueError if an entity is not a body, if both are the same, or if a number is out of range.
        """
        world = self._world()
        for name, entity in (("a", a), ("b", b)):
            try:
                world.bodies.row_of(entity)
            except (KeyError, TypeError):
                raise ValueError(
                    f"springs.connect: {name} must be the entity of a body (Transform and RigidBody or a collider) in "
                    f"world {world.name!r}, got {entity!r}"
                ) from None
        if a == b:
            raise ValueError(f"springs.connect: a spring needs two bodies, got entity {a} twice")
        rest = _distance(world.bodies, a, b) if rest_length is None else rest_length
        spring = Spring(self, int(a), int(b), rest, stiffness, damping, only_pulls)
        self._give_number(spring)
        self._springs[spring] = None
        self._changed()
        return spring

    def of(self, entity: int) -> list[Spring]:
        """The springs at that entity, in order of their creation."""
        return [spring for spring in self._springs if entity in (spring.a, spring.b)]

    def clear(self) -> None:
        """Remove all springs."""
        self._springs.clear()
        self._changed()

    @property
    def highest_frequency(self) -> float:
        """rad/s, an upper bound of the oscillation frequencies of the bodies; exact for a single spring.

        With D the sum of stiffnesses at a body and m its mass: the largest D/m + D'/m' of two connected bodies
        (Gershgorin's circles of the springs' matrix). A step dt holds them if dt times this is below 2.
        """
        bodies = self._world().bodies
        return math.sqrt(self._current(bodies).rates(bodies)[0])

    # -- snapshots --------------------------------------------------------------------------------

    def saved(self, world: World) -> Any:
        """(n, 7) number, a, b and the fields of all springs, in order of their creation."""
        return [[s._number, s.a, s.b, s.rest_length, s.stiffness, s.damping, s.only_pulls] for s in self._springs]

    def take_back(self, world: World, saved: Any) -> None:
        """Connect these springs and no others."""
        self._springs.clear()
        for number, a, b, *fields in saved:
            spring = self._by_number.get(number)
            if spring is None or (spring.a, spring.b) != (a, b):
                spring = Spring(self, a, b, *fields)
                self._give_number(spring, number)
            else:
                spring.rest_length, spring.stiffness, spring.damping, spring.only_pulls = fields
            self._springs[spring] = None
        self._changed()

    def __len__(self) -> int:
        return len(self._springs)

    def __iter__(self) -> Iterator[Spring]:
        return iter(list(self._springs))

    def __contains__(self, spring: object) -> bool:
        return spring in self._springs

    # -- for springs and systems ------------------------------------------------------------------

    def _world(self) -> World:
        if self.world is None:
            raise CaromError("these springs are in no world yet: World(Physics(...), springs)")
        return self.world

    def _give_number(self, spring: Spring, number: int | None = None) -> None:
        """Give it a number that no other has, or the one that it has had in another process."""
        if number is None:
            number = next(n for n in self._numbers if n not in self._by_number)
        spring._number = number
        self._by_number[number] = spring

    def _remove(self, spring: Spring) -> None:
        self._springs.pop(spring, None)
        self._changed()

    def _changed(self) -> None:
        self._columns = None

    def _current(self, bodies: Bodies) -> _Columns:
        """The springs' columns, rebuilt if springs or rows have changed."""
        if self._columns is None or not self._columns.fits(bodies):
            self._columns = _Columns(list(self._springs), bodies)
        return self._columns

    def _now(self, spring: Spring) -> tuple[float, float]:
        bodies = self._world().bodies
        columns = _Columns([spring], bodies)
        length, _, tension = columns.tension(bodies)
        return float(length[0]), float(tension[0])


class _Columns:
    """Springs as arrays, sorted by lower id, higher id, then fields, independent of the order of creation."""

    def __init__(self, springs: list[Spring], bodies: Bodies) -> None:
        self.entity = bodies.entity.copy()
        order = np.argsort(self.entity, kind="stable")
        ranked = self.entity[order]
        ends = np.array([sorted((spring.a, spring.b)) for spring in springs], np.int64).reshape(-1, 2)
        places = np.minimum(np.searchsorted(ranked, ends), max(len(ranked) - 1, 0))
        here = (ranked[places] == ends).all(axis=1) if len(ranked) else np.zeros(len(springs), bool)
        fields = np.array([(s.rest_length, s.stiffness, s.damping, s.only_pulls) for s in springs]).reshape(-1, 4)
        self.missing = [spring for spring, known in zip(springs, here, strict=True) if not known]
        ends, fields, rows = ends[here], fields[here], order[places[here]] if len(ranked) else places[here]
        ranking = np.lexsort((*fields.T[::-1], ends[:, 1], ends[:, 0]))
        self.low, self.high = rows[ranking].T
        self.rest_length, self.stiffness, self.damping, pulls = fields[ranking].T
        self.only_pulls = pulls.astype(bool)

    def fits(self, bodies: Bodies) -> bool:
        return np.array_equal(self.entity, bodies.entity)

    def tension(self, bodies: Bodies) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(length (n,), unit vector (n, d) from the lower to the higher id, attractive force (n,))."""
        position, velocity = bodies.position, bodies.linear_velocity
        apart = position[self.high] - position[self.low]
        length = np.abs(apart[:, 0])
        for k in range(1, apart.shape[1]):
            length = np.hypot(length, apart[:, k])  # avoids overflow of a square
        unit = np.divide(apart, length[:, None], out=np.zeros_like(apart), where=length[:, None] > 0)
        speed = ((velocity[self.high] - velocity[self.low]) * unit).sum(axis=1)
        tension = self.stiffness * (length - self.rest_length) + self.damping * speed
        slack = self.only_pulls & ((length <= self.rest_length) | (tension < 0))
        return length, unit, np.where(slack, 0.0, tension)

    def forces(self, bodies: Bodies) -> np.ndarray:
        """(rows, d), the forces on all bodies; each body's springs are summed in the order of the columns."""
        _, unit, tension = self.tension(bodies)
        pull = tension[:, None] * unit
        rows, both = np.concatenate((self.low, self.high)), np.concatenate((pull, -pull))
        return np.stack([np.bincount(rows, column, len(bodies)) for column in both.T], axis=1)

    def energy(self, bodies: Bodies) -> float:
        stretch = self.tension(bodies)[0] - self.rest_length
        stretch = np.where(self.only_pulls, np.maximum(stretch, 0.0), stretch)
        return float((0.5 * self.stiffness * stretch * stretch).sum())

    def rates(self, bodies: Bodies) -> tuple[float, float]:
        """The largest rates of stiffness (1/s^2) and damping (1/s): for each spring the sums of all springs at both of
        its bodies, each divided by the body's mass, are added. Immovable bodies count as infinitely heavy."""
        inverse_mass = np.zeros(len(bodies))
        inverse_mass[bodies.dynamic.rows] = 1.0 / bodies.dynamic.mass
        ends = np.concatenate((self.low, self.high))
        found = []
        for weights in (self.stiffness, self.damping):
            at = np.bincount(ends, np.concatenate((weights, weights)), len(bodies)) * inverse_mass
            found.append(float((at[self.low] + at[self.high]).max(initial=0.0)))
        return found[0], found[1]


class SpringForces(ForceSystem):
    """The forces of all springs."""

    def __init__(self, springs: Springs) -> None:
        self._springs = springs

    def add_forces(self, bodies: Any, time: float) -> None:
        if len(self._springs):
            everything = self.world.bodies
            bodies.force += self._springs._current(everything).forces(everything)[everything.dynamic.rows]

    def potential_energy(self, bodies: Any) -> float:
        """Joules: half stiffness times stretch squared, summed in the springs' own order."""
        everything = self.world.bodies
        return self._springs._current(everything).energy(everything)


class LostSprings(System):
    """Removes the springs of deleted bodies and reports them; checks that the step holds the others."""

    phase = Phase.START

    def __init__(self, springs: Springs) -> None:
        self._springs = springs
        self._looked_at: tuple[Any, float] = (None, 0.0)

    def process(self, dt: float) -> None:
        if not len(self._springs):
            return
        columns = self._springs._current(self.world.bodies)
        for spring in columns.missing:
            spring.remove()
            self.world.dispatch_event("spring_lost", spring)
        if self._looked_at != (columns, dt):
            self._looked_at = (columns, dt)
            self._look_at_step(columns, dt)

    def _look_at_step(self, columns: _Columns, dt: float) -> None:
        """Record a fault if semi-implicit Euler is unstable: (dt w)^2 + 2 dt c/m > 4."""
        stiff, damped = columns.rates(self.world.bodies)
        if dt * dt * stiff + 2 * dt * damped >= STABLE**2:
            longest = 4.0 / (damped + math.sqrt(damped * damped + 4.0 * stiff))
            self.world.report_fault(
                f"springs: dt = {dt:.3g} s is too long for springs this stiff on bodies this light (highest frequency "
                f"{math.sqrt(stiff):.4g} rad/s, damping rate {damped:.4g} /s); they hold up to dt = {longest:.3g} s: "
                f"use smaller steps, softer springs or heavier bodies",
                kind="springs",
            )  # fmt: skip

    def reason(self) -> str:
        return f"{len(self._springs)} springs: removes those whose bodies are gone"


def _distance(bodies: Bodies, a: int, b: int) -> float:
    position = bodies.position
    return math.hypot(*(position[bodies.row_of(b)] - position[bodies.row_of(a)]))


def _number(name: str, value: Any) -> float:
    number = isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_))
    if not number or not (math.isfinite(value) and float(value) >= 0):
        raise ValueError(f"Spring.{name} must be a finite number of at least 0, got {value!r}")
    return float(value)
