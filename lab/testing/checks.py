"""Assertions about worlds. Each message names the entity, the step, the value and the limit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from ...framework import Contact, Phase, System, World
from ...framework.typing import Integers
from ..measure.bodies import Floats, overlaps_of, sizes_of


class Conserved:
    """The state at construction, to be compared later: energy, momentum, the bodies, finite numbers.

    Energy is kinetic plus potential energy. ``relative`` is relative to the energy at the start, and for momentum to
    sum(m |v|); rounding stays below 1e-12.

    following: for games in which bodies come and go: what they bring and take is added to what is expected. Two systems
    of the world look at the start and at the end of each step; ``close`` removes them
    """

    def __init__(self, world: World, relative: float = 1e-12, *, following: bool = False) -> None:
        self.world, self.relative, self.following = world, relative, following
        self.bodies = len(world.bodies)
        self.momentum = world.momentum()
        self.energy = energy(world)
        self.kinetic = world.kinetic_energy()
        self.momentum_scale = self._sum_of_momenta()
        self._entities = self._start = _ids(world)
        self._last = self.momentum, self.energy  # where the bodies were last known to be the same
        calls = _Calls(Phase.START, self.account), _Calls(Phase.END, self.note)  # around all that is there now
        self._systems: list[System] = [*calls] if following else []
        for system in self._systems:
            world.add_system(system)

    def close(self) -> None:
        """Stop following."""
        for system in self._systems:
            self.world.remove_system(system)
        self._systems = []

    def _sum_of_momenta(self) -> float:
        moving = self.world.bodies.dynamic
        return float(np.abs(moving.mass[:, None] * moving.linear_velocity).sum())

    def note(self) -> None:
        """At the end of a step."""
        self._last = self.world.momentum(), energy(self.world)

    def account(self) -> None:
        """Expect what bodies have brought that came, and not what those took that went, since the last step."""
        entities = _ids(self.world)
        if np.array_equal(entities, self._entities):
            return
        if not self.following:
            came, gone = np.setdiff1d(entities, self._entities), np.setdiff1d(self._entities, entities)
            raise AssertionError(
                f"step {self.world.step_count}: bodies came ({_some(came)}) or went ({_some(gone)}): "
                f"Conserved(world, following=True) takes account of what they bring and take"
            )
        now = self.world.momentum(), energy(self.world)
        self.momentum = self.momentum + now[0] - self._last[0]
        self.energy += now[1] - self._last[1]
        self.kinetic = max(self.kinetic, self.world.kinetic_energy())
        self.momentum_scale = max(self.momentum_scale, self._sum_of_momenta())
        self._entities, self._last = entities, now

    def assert_finite(self) -> None:
        """Every position and velocity is finite."""
        bodies, step = self.world.bodies, self.world.step_count
        for name in ("position", "linear_velocity"):
            column = getattr(bodies, name)
            for row in np.flatnonzero(~np.isfinite(column).all(axis=1))[:1]:
                raise AssertionError(f"entity {bodies.entity[row]}, step {step}: {name} is {column[row].tolist()}")

    def assert_same_bodies(self) -> None:
        """The bodies are those of the beginning."""
        entities = _ids(self.world)
        came, gone = np.setdiff1d(entities, self._start), np.setdiff1d(self._start, entities)
        assert not len(came) + len(gone), (
            f"step {self.world.step_count}: {len(entities)} bodies, there were {self.bodies}; came: {_some(came)}; "
            f"gone: {_some(gone)}"
        )

    def assert_momentum(self) -> None:
        """Momentum is unchanged: valid without external forces and without immovable bodies."""
        self.account()
        off = float(np.abs(self.world.momentum() - self.momentum).max())
        limit = self.relative * max(self.momentum_scale, self._sum_of_momenta())
        assert off <= limit, (
            f"step {self.world.step_count}: momentum is {self.world.momentum().tolist()}, it was "
            f"{self.momentum.tolist()}: {off:.3g} kg m/s apart, limit {limit:.3g}"
        )

    def assert_energy(self) -> None:
        """Energy is unchanged."""
        self._energy(abs)

    def assert_energy_not_raised(self) -> None:
        """Energy is unchanged or lower."""
        self._energy(float)

    def _energy(self, measure: Callable[[float], float]) -> None:
        self.account()
        now = energy(self.world)
        limit = self.relative * max(abs(self.energy), self.kinetic)
        assert measure(now - self.energy) <= limit, (
            f"step {self.world.step_count}: energy is {now:.12g} J, it was {self.energy:.12g} J: "
            f"{now - self.energy:+.3g} J, limit {limit:.3g}"
        )


class _Calls(System):
    """Calls a function once a step, in that phase."""

    def __init__(self, phase: Phase, function: Callable[[], None]) -> None:
        self.phase = phase  # type: ignore[misc]
        self.function = function

    def process(self, dt: float) -> None:
        self.function()


def _ids(world: World) -> Integers:
    """Of all bodies, ascending."""
    return np.sort(world.bodies.entity)


def _some(entities: Integers) -> str:
    """The first of these ids."""
    shown = ", ".join(map(str, entities[:5].tolist()))
    return f"{shown} and {len(entities) - 5} more" if len(entities) > 5 else shown or "none"


def energy(world: World) -> float:
    """Kinetic plus potential energy, J."""
    return world.kinetic_energy() + world.potential_energy()


# -- position and velocity --------------------------------------------------------------------------


def assert_position(world: World, entity: int, expected: Any, within: float = 1e-9) -> None:
    """The entity is at ``expected``, (d,) m, to ``within`` m on every axis."""
    _assert_vector(world, entity, "position", "m", expected, within)


def assert_velocity(world: World, entity: int, expected: Any, within: float = 1e-9) -> None:
    """The entity has the velocity ``expected``, (d,) m/s, to ``within`` m/s on every axis."""
    _assert_vector(world, entity, "linear_velocity", "m/s", expected, within)


def _assert_vector(world: World, entity: int, name: str, unit: str, expected: Any, within: float) -> None:
    assert entity in world.bodies.entity, f"entity {entity}, step {world.step_count}: it is no body, or no more"
    got = np.asarray(getattr(world.bodies, name)[world.bodies.row_of(entity)])
    off = float(np.abs(got - np.asarray(expected, float)).max())
    assert off <= within, (
        f"entity {entity}, step {world.step_count}: {name} is {got.tolist()}, expected "
        f"{np.asarray(expected, float).tolist()}: {off:.3g} {unit} apart, limit {within:.3g}"
    )


def assert_inside(world: World, lower: Any, upper: Any) -> None:
    """All positions of dynamic bodies are from ``lower`` to ``upper``, (d,) m or one number for all axes."""
    moving = world.bodies.dynamic
    inside = ((moving.position >= lower) & (moving.position <= upper)).all(axis=1)
    for row in np.flatnonzero(~inside)[:1]:
        raise AssertionError(
            f"entity {moving.entity[row]}, step {world.step_count}: position {moving.position[row].tolist()} is "
            f"outside of {lower} to {upper}; {int((~inside).sum())} of {len(moving)} bodies are"
        )


def assert_at_rest(world: World, steps: int = 60, speed: float = 1e-3, drift: float = 1e-3) -> None:
    """Take that many steps: no dynamic body ever moves faster than ``speed`` sizes per second or by ``drift`` sizes.

    The size of a body is the smallest extent of its collider; 1 m without a collider. Bodies may come and go; the drift
    of one that comes is that from where it is at the end of its first step.
    """
    entities, sizes, start = _moving_ids(world), _sizes(world), np.array(world.bodies.dynamic.position)
    for _ in range(steps):
        world.step()
        moving, now = world.bodies.dynamic, _moving_ids(world)
        if not np.array_equal(now, entities):
            _, new, old = np.intersect1d(now, entities, return_indices=True)
            places = np.array(moving.position)
            places[new] = start[old]
            entities, sizes, start = now, _sizes(world), places
        speeds = np.linalg.norm(moving.linear_velocity, axis=1) / sizes
        _assert_largest(world, speeds, speed, "moves at", "sizes per second")
        moved = np.linalg.norm(moving.position - start, axis=1) / sizes
        _assert_largest(world, moved, drift, "has drifted by", "sizes")


def _moving_ids(world: World) -> Integers:
    return np.array(world.bodies.dynamic.entity)


def _sizes(world: World) -> Floats:
    known = sizes_of(world)
    return np.array([known.get(entity, 1.0) or 1.0 for entity in world.bodies.dynamic.entity.tolist()])


def _assert_largest(world: World, values: Floats, limit: float, verb: str, unit: str) -> None:
    if len(values) and not values.max() <= limit:
        row = int(np.argmax(values))
        raise AssertionError(
            f"entity {world.bodies.dynamic.entity[row]}, step {world.step_count}: {verb} {values[row]:.3g} {unit}, "
            f"limit {limit:.3g}"
        )


# -- contacts ---------------------------------------------------------------------------------------


def touching(world: World, a: int, b: int) -> bool:
    """True if the two touched in the last step (a disabled contact does not count)."""
    return any(contact.entity_b == b for contact in world.contacts.of(a))


def assert_touching(world: World, a: int, b: int) -> None:
    """a and b touched in the last step."""
    others = sorted({contact.entity_b for contact in world.contacts.of(a)})
    assert touching(world, a, b), f"step {world.step_count}: {a} does not touch {b}; it touches {others or 'nothing'}"


def assert_apart(world: World, a: int, b: int) -> None:
    """a and b did not touch in the last step."""
    for contact in world.contacts.of(a):
        if contact.entity_b == b:
            raise AssertionError(f"step {world.step_count}: {a} touches {b}, overlapping by {contact.depth:.3g} m")


class ContactLog:
    """Counts contact events of pairs from now on, however the world is stepped. Close it, or drop the world."""

    EVENTS = ("contact_begin", "contact_end", "impact")

    def __init__(self, world: World) -> None:
        self.world = world
        self._counts: Counter[tuple[str, int, int]] = Counter()
        self._handlers = {name: world.on(name, self._counter(name)) for name in self.EVENTS}

    def _counter(self, name: str) -> Callable[[Contact], None]:
        def count(contact: Contact) -> None:
            self._counts[name, contact.entity_a, contact.entity_b] += 1

        return count

    def close(self) -> None:
        """Stop counting."""
        for name, handler in self._handlers.items():
            self.world.off(name, handler)
        self._handlers.clear()

    def count(self, event: str, a: int, b: int) -> int:
        """The number of events; event: contact_begin, contact_end or impact."""
        return self._counts[event, min(a, b), max(a, b)]

    def assert_began(self, a: int, b: int, times: int = 1) -> None:
        """They began to touch exactly that many times."""
        self._assert("contact_begin", "began to touch", a, b, times)

    def assert_ended(self, a: int, b: int, times: int = 1) -> None:
        """They ceased to touch exactly that many times."""
        self._assert("contact_end", "ceased to touch", a, b, times)

    def assert_struck(self, a: int, b: int, times: int = 1) -> None:
        """They had exactly ``times`` impacts."""
        self._assert("impact", "struck each other", a, b, times)

    def _assert(self, event: str, verb: str, a: int, b: int, times: int) -> None:
        got = self.count(event, a, b)
        assert got == times, f"step {self.world.step_count}: {a} and {b} {verb} {got} times, expected {times}"


def assert_no_overlap(world: World, sizes: float = 0.01) -> None:
    """No two solid shapes, one of them dynamic, overlap by more than ``sizes`` of the smaller one.

    As the contacts of the last step have it.
    """
    for one, other, depth, size in zip(*overlaps_of(world), strict=True):
        assert depth <= sizes * size, (
            f"step {world.step_count}: {one} and {other} overlap by {depth / size:.3g} of the smaller one's size, "
            f"limit {sizes:.3g}"
        )


# -- the same bits ----------------------------------------------------------------------------------


def assert_same_bits(one: World, other: World) -> None:
    """``one`` and ``other`` have equal ids and equal bits in all columns of bodies; the message names the first entity
    and column that differ."""
    if one.state_hash() == other.state_hash():
        return
    bodies, others = one.bodies, other.bodies
    ids = np.sort(bodies.entity)
    assert np.array_equal(ids, np.sort(others.entity)), (
        f"step {one.step_count}: the worlds have different bodies, {len(bodies)} and {len(others)}"
    )
    for entity in ids.tolist():
        row, other_row = bodies.row_of(entity), others.row_of(entity)
        for name in bodies.column_names():
            if name not in others.column_names():
                continue
            mine, theirs = getattr(bodies, name)[row], getattr(others, name)[other_row]
            assert np.array_equal(mine, theirs, equal_nan=np.asarray(mine).dtype.kind == "f"), (
                f"entity {entity}, step {one.step_count} and {other.step_count}: {name} is "
                f"{np.asarray(mine).tolist()} and {np.asarray(theirs).tolist()}"
            )
    raise AssertionError(f"step {one.step_count}: the worlds' components differ")


def assert_frame_rate_free(build: Callable[[], World], seconds: float = 2.0, rates: Any = (30, 60, 144)) -> None:
    """Worlds from ``build`` reach the same bits after ``seconds`` at each of the frame ``rates``, 1/s."""
    worlds = []
    for rate in rates:
        world = build()
        steps = round(seconds / world.settings.dt)
        most = int(1 / rate / world.settings.dt) + 2  # steps of one frame
        while world.step_count + most <= steps:
            world.advance(1 / rate)
        while world.step_count < steps:
            world.step()
        worlds.append(world)
    try:
        for world in worlds[1:]:
            assert_same_bits(worlds[0], world)
    finally:
        for world in worlds:
            world.close()
