"""Stiffness of a world's forces in the present state: the oscillators that they form with the bodies.

The changes of the forces for small shifts of the bodies, and for small changes of their velocities, give the matrices
of stiffness and drag, each divided by the masses. Where force systems give torques, turns count beside shifts, with
moments of inertia for masses. Their modes are independent oscillators x'' = -k x - c x'. The world
is left unchanged, bit for bit; force systems are evaluated several times, which they must allow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from ...components.spin import Spin, axes_of
from ...framework import World
from ...framework.data.bodies import Bodies
from ...framework.data.table import Table
from ...framework.jit.records.record import Record
from .stability import Floats

EPS = float(np.finfo(float).eps)
SHIFT = 1e-5  # relative to the distance between bodies, and to their speed
FARTHEST = 1e-8  # relative to the coordinates: smaller shifts would be lost to rounding far from the origin
KINK = 0.01  # a relative difference above this between forward and backward shifts means a kink in the force
NOISE = 1e-7  # relative to the largest of its kind: smaller values are rounding
ALL = 60  # degrees of freedom up to which all modes are found
WIDTH, ROUNDS = 6, 30  # of the power iteration: vectors, and rounds at most
CONVERGED = 1e-6  # relative change of the largest mode that ends it

# What summing forces changes in the state beside the columns.
FORCE_STATE = ("stage", "force_evaluations", "pushed", "unforced", "forces_summed")

Apply: TypeAlias = Callable[[Floats], Floats]


@dataclass(frozen=True)
class Modes:
    """Oscillators x'' = -stiffness x - (drag + damping) x', each (m,).

    entity: the body with the largest amplitude
    stiffness, drag: 1/s^2 and 1/s, by forces; complex if forces turn the motion
    damping: 1/s, linear_damping or angular_damping
    """

    entity: np.ndarray
    stiffness: np.ndarray
    drag: np.ndarray
    damping: Floats


class Forces:
    """The forces of a world's dynamic bodies as functions of their state: see :func:`forces_of`.

    Vectors have one number per degree of freedom, times the root of its mass, so that the matrices of forces with a
    potential are symmetric. Those of turns, about the principal axes of the bodies, come after those of places.

    entity, damping: of each degree of freedom
    """

    def __init__(self, world: World) -> None:
        self._world, d = world, world.dimensions or 0
        self._services: Any = world.physics
        bodies, table = world.bodies.dynamic, self._services.table
        turning = self._services.forces.kind()[1]
        self._spins = np.flatnonzero(bodies.has(Spin)) if turning else np.empty(0, int)
        names = ["position", "linear_velocity", "force"] + ["rotation", "spin.angular_velocity", "torque"] * turning
        self._columns = {name: table.make(name)[bodies.rows] for name in names}
        self._kept = {name: column.copy() for name, column in self._columns.items()}
        self.entity, self.damping = np.repeat(bodies.entity, d), np.repeat(np.array(bodies.linear_damping), d)
        self._root, self._places = np.sqrt(np.repeat(bodies.mass, d)), d * len(bodies)
        position, velocity = (_finite(self._kept[name]) for name in ("position", "linear_velocity"))
        length = _spacing(position, _finite(world.bodies.position))
        shift = {
            "position": _power_of_two(max(SHIFT * length, FARTHEST * float(np.abs(position).max(initial=0.0)))),
            "linear_velocity": _power_of_two(SHIFT * (float(np.abs(velocity).max(initial=0.0)) or length)),
        }
        self._shift = {name: np.full(self._places, value) for name, value in shift.items()}
        if len(self._spins):
            self._add_turns(bodies)

    def _add_turns(self, bodies: Bodies) -> None:
        table, entities = self._services.table, bodies.entity[self._spins]
        axes, moments = zip(*(_principal(table, int(entity)) for entity in entities), strict=True)
        self._axes, root = np.array(axes), np.sqrt(np.ravel(moments))
        each, damping = len(root) // len(entities), np.array(bodies.spin.angular_damping[self._spins])
        self._root = np.append(self._root, np.where(root > 0.0, root, np.inf))  # what has no moment does not turn
        self.entity = np.append(self.entity, np.repeat(entities, each))
        self.damping = np.append(self.damping, np.repeat(damping, each))
        turned, spun = (_largest(self._kept[name][self._spins]) for name in ("rotation", "spin.angular_velocity"))
        for name, angle in (("position", max(SHIFT, FARTHEST * turned)), ("linear_velocity", SHIFT * (spun or 1.0))):
            self._shift[name] = np.append(self._shift[name], np.full(len(root), _power_of_two(angle)))

    def begin(self) -> None:
        """Sum the forces at the present state; ValueError if they are not finite."""
        self._rest = self._sum()

    def restore(self) -> None:
        """Put back the state of the bodies."""
        for name, column in self._columns.items():
            column[:] = self._kept[name]

    def __len__(self) -> int:
        return len(self._root)

    def stiffness(self, direction: Floats) -> Floats:
        """Minus the change of the forces per shift in that direction."""
        return self._answer("position", direction)

    def drag(self, direction: Floats) -> Floats:
        """Minus the change of the forces per change of the velocities in that direction."""
        return self._answer("linear_velocity", direction)

    def noise(self, name: str) -> float:
        """The rounding error of stiffness ("position") or drag ("linear_velocity")."""
        return 8 * EPS * float(np.abs(self._rest / self._root / self._shift[name]).max(initial=0.0))

    def _answer(self, name: str, direction: Floats) -> Floats:
        moved = direction / self._root
        largest = float(np.abs(moved / self._shift[name]).max())
        if largest == 0.0:
            return np.zeros(len(self))
        scale = 1.0 / largest
        answers = []
        for sign in (1.0, -1.0):
            self._move(name, sign * scale * moved)
            answers.append(-sign * (self._sum() - self._rest) / scale)
        self._move(name, np.zeros(len(self)))
        there, back = answers
        if np.abs(there - back).max() > KINK * max(np.abs(there).max(), np.abs(back).max()):
            return max(there, back, key=lambda answer: float(np.abs(answer).max()))  # a rope: take the taut side
        return (there + back) / 2

    def _move(self, name: str, by: Floats) -> None:
        """Shift the bodies, or change their velocities, by so much from where they were, and turn them."""
        start, turns = self._kept[name], name == "position"
        self._columns[name][:] = start + by[: self._places].reshape(start.shape)
        if not len(self._spins):
            return
        turn = np.einsum("bij,bj->bi", self._axes, by[self._places :].reshape(len(self._spins), -1))
        name = "rotation" if turns else "spin.angular_velocity"
        start = self._kept[name][self._spins]
        if start.ndim == 1:
            self._columns[name][self._spins] = start + turn[:, 0]
        else:
            self._columns[name][self._spins] = _turned(start, turn) if turns else start + turn

    def _sum(self) -> Floats:
        self._services.forces.evaluate(self._world.time)
        sums = self._columns["force"].ravel()
        if len(self._spins):
            torque = self._columns["torque"][self._spins].reshape(len(self._spins), -1)
            sums = np.concatenate((sums, np.einsum("bij,bi->bj", self._axes, torque).ravel()))
        bad = np.flatnonzero(~np.isfinite(sums))
        if len(bad):
            entity, acting = self.entity[bad[0]], "forces" if bad[0] < self._places else "forces and torques"
            raise ValueError(f"entity {entity}: the {acting} on it are {sums[self.entity == entity].tolist()}")
        return sums / self._root


@contextmanager
def forces_of(world: World) -> Iterator[Forces]:
    """The forces of a world, which is as it was afterwards, to the bit."""
    services: Any = world.physics
    services.refresh_for_queries()  # the stages see the bodies that there are
    with unmeasured(services.state), world:
        forces = Forces(world)
        try:
            forces.begin()
            yield forces
        finally:
            forces.restore()


@contextmanager
def unmeasured(state: Record) -> Iterator[None]:
    """Leave no trace of the stages that run inside: neither in what the world measures nor in what it knows of its
    forces."""
    numbers = {name: getattr(state, name) for name in FORCE_STATE}
    measured = state.ticks.copy(), state.calls.copy()
    try:
        yield
    finally:
        for name, value in numbers.items():
            setattr(state, name, value)
        state.ticks[:], state.calls[:] = measured


def modes_of(world: World) -> Modes:
    """The stiffest and the most damped oscillators that the force systems of ``world`` form with its dynamic bodies.

    All of them if the bodies have at most ALL degrees of freedom. ValueError if the forces are not finite.
    """
    if not world.force_systems or not len(world.bodies.dynamic):
        return Modes(np.empty(0, np.int64), np.empty(0), np.empty(0), np.empty(0))
    with forces_of(world) as forces:
        spaces = [np.eye(len(forces))]
        if len(forces) > ALL:
            spaces = [_dominant(ask, len(forces)) for ask in (forces.stiffness, forces.drag)]
        basis = np.linalg.qr(np.concatenate(spaces, axis=1))[0]
        return _modes_in(basis, _images(forces.stiffness, basis), _images(forces.drag, basis), forces)


def _images(apply: Apply, vectors: Floats) -> Floats:
    return np.stack([apply(vector) for vector in vectors.T], axis=1)


def _dominant(apply: Apply, n: int) -> Floats:
    """(n, WIDTH): a basis of the largest modes, by power iteration of several vectors at once (Saad, Numerical Methods
    for Large Eigenvalue Problems, section 5.1)."""
    basis = np.linalg.qr(np.random.default_rng(0).normal(size=(n, WIDTH)))[0]
    largest = 0.0
    for _ in range(ROUNDS):
        image = _images(apply, basis)
        before, largest = largest, float(np.abs(np.linalg.eigvals(basis.T @ image)).max())
        if abs(largest - before) <= CONVERGED * largest:
            break
        basis = np.linalg.qr(image)[0]
    return basis


def _modes_in(basis: Floats, by_stiffness: Floats, by_drag: Floats, forces: Forces) -> Modes:
    """The modes of x'' = -K x - (C + G) x' in the space of that basis (n, m), whose images under K and C are given.

    Their Rayleigh quotients k, c and g satisfy x'' = -k x - (c + g) x' exactly if the space holds the mode.
    """
    m, damping = basis.shape[1], forces.damping[:, None]
    upper = np.concatenate((np.zeros((m, m)), np.eye(m)), axis=1)
    lower = -np.concatenate((basis.T @ by_stiffness, basis.T @ (by_drag + damping * basis)), axis=1)
    small = np.linalg.eig(np.concatenate((upper, lower)))[1][:m]
    vectors = basis @ small
    weights = np.abs(vectors) ** 2
    squares = weights.sum(axis=0)
    k, c = ((np.conj(vectors) * (image @ small)).sum(axis=0) / squares for image in (by_stiffness, by_drag))
    g = (weights * damping).sum(axis=0) / squares
    stiffest, fastest = float(np.abs(k).max()), float(np.abs(c).max())
    k = _cleaned(k, max(NOISE * stiffest, forces.noise("position")))
    c = _cleaned(c, max(NOISE * max(fastest, stiffest**0.5), forces.noise("linear_velocity")))
    return Modes(forces.entity[np.argmax(weights, axis=0)], k, c, g)


def _cleaned(values: Any, noise: float) -> Any:
    real, turning = (np.where(np.abs(part) > noise, part, 0.0) for part in (values.real, values.imag))
    return real + 1j * turning


def _principal(table: Table, entity: int) -> tuple[Floats, Floats]:
    """(a body's principal axes as columns along those of the world, its moments of inertia about them)."""
    spin = object.__new__(Spin)
    spin._bind(table, entity)
    moments = spin.moments
    if not np.ndim(moments):
        return np.eye(1), np.array([moments])
    principal, own = np.linalg.eigh(moments)
    principal = np.where(principal > 8 * EPS * principal[-1], principal, 0.0)
    return axes_of(table.column("rotation")[table.find(entity)]) @ own, principal


def _turned(rotation: Floats, turn: Floats) -> Floats:
    """Quaternions (n, 4), turned by small vectors (n, 3)."""
    w, u = rotation[:, :1], rotation[:, 1:]
    half = 0.5 * turn
    moved = w - (half * u).sum(axis=1, keepdims=True), u + w * half + np.cross(half, u)
    turned = np.concatenate(moved, axis=1)
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)


def _spacing(dynamic: Floats, everything: Floats) -> float:
    """Typical distance between bodies, m; for a single body its distance from the origin; else 1."""
    for places in (dynamic, everything):
        wide = float(np.ptp(places, axis=0).max()) if len(places) else 0.0
        if wide > 0.0:
            return wide / len(places) ** (1 / places.shape[1])
    return float(np.abs(dynamic).max(initial=0.0)) or 1.0


def _largest(values: Floats) -> float:
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def _finite(rows: Floats) -> Floats:
    return rows[np.isfinite(rows).all(axis=1)]


def _power_of_two(value: float) -> float:
    return float(2.0 ** np.round(np.log2(value)))
