"""The oscillators that a world's forces form with its bodies in the present state.

Small shifts of the bodies, and small changes of their velocities, give the matrices of stiffness and drag; turns count
beside shifts where forces give torques. Force systems are evaluated several times, which they must allow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...components.spin import Spin, axes_of
from ...framework import World
from ...framework.jit.records.record import Record
from .stability import Floats

EPS = float(np.finfo(float).eps)
SHIFT = 1e-5  # of the distance between bodies and of their speed, and in rad
FARTHEST = 1e-8  # of the coordinates: smaller shifts would be lost to rounding far from the origin
KINK = 0.01  # a relative difference above this between forward and backward shifts means a kink in the force
NOISE = 1e-7  # of the largest of its kind: smaller values are rounding
ALL = 60  # degrees of freedom up to which all modes are found
WIDTH, ROUNDS, CONVERGED = 6, 30, 1e-6  # of the power iteration: vectors, most rounds, change of the largest mode
NAMES = "position", "linear_velocity", "force", "rotation", "spin.angular_velocity", "torque"
FORCE_STATE = "stage", "force_evaluations", "pushed", "unforced", "forces_summed"  # what summing forces changes


class Modes(NamedTuple):
    """Oscillators x'' = -stiffness x - (drag + damping) x', each (m,): 1/s^2 and 1/s, complex where forces turn the
    motion; damping is linear or angular; entity: the body with the largest amplitude."""

    entity: Any
    stiffness: Any
    drag: Any
    damping: Any


class Forces:
    """The forces on the dynamic bodies of a world as functions of their state.

    Vectors have a number for each degree of freedom, times the root of its mass or moment of inertia, so that forces
    with a potential have symmetric matrices. Turns, about the principal axes of a body, come after all shifts.
    """

    def __init__(self, world: World) -> None:
        self._world, bodies = world, world.bodies.dynamic
        self._services: Any = world.physics
        table, turning, d = self._services.table, self._services.forces.kind()[1], world.dimensions or 0
        self._columns = {name: table.make(name)[bodies.rows] for name in NAMES[: 6 if turning else 3]}
        self._kept = {name: column.copy() for name, column in self._columns.items()}
        self._spins = np.flatnonzero(bodies.has(Spin)) if turning else np.empty(0, int)
        found = [_principal(table, entity) for entity in bodies.entity[self._spins].tolist()]
        moments = np.ravel([moment for _, moment in found])
        self._axes, each = np.array([axes for axes, _ in found]), len(moments) // max(len(found), 1)
        self._shifts = d * len(bodies)
        self._root = np.sqrt(np.append(np.repeat(bodies.mass, d), np.where(moments > 0.0, moments, np.inf)))
        self.entity = np.append(np.repeat(bodies.entity, d), np.repeat(bodies.entity[self._spins], each))
        turned = bodies.spin.angular_damping[self._spins] if len(found) else []
        self.damping = np.append(np.repeat(bodies.linear_damping, d), np.repeat(turned, each))
        length, speed = _spacing(world.bodies.position), _largest(self._kept["linear_velocity"])
        spin = _largest(self._kept["spin.angular_velocity"]) if len(found) else 0.0
        far = FARTHEST * _largest(self._kept["position"])
        shifts = {"position": (max(SHIFT * length, far), SHIFT),
                  "linear_velocity": (SHIFT * (speed or length), SHIFT * (spin or 1.0))}  # fmt: skip
        self._shift = {name: np.repeat(of, (self._shifts, len(moments))) for name, of in shifts.items()}

    def begin(self) -> None:
        """Sum the forces where the bodies are."""
        self._rest = self._sum()

    def __len__(self) -> int:
        return len(self._root)

    def change(self, name: str, direction: Floats) -> Floats:
        """Minus the change of the forces per shift in that direction, or of the velocities: stiffness or drag."""
        moved = direction / self._root
        scale = float(np.abs(moved / self._shift[name]).max()) or 1.0
        there, back = (sign * scale * (self._rest - self._forces_at(name, sign / scale * moved)) for sign in (1, -1))
        if np.abs(there - back).max() > KINK * max(np.abs(there).max(), np.abs(back).max()):
            return max(there, back, key=lambda change: float(np.abs(change).max()))  # a rope: the taut side
        return (there + back) / 2

    def noise(self, name: str) -> float:
        """The rounding error of such changes."""
        return 8 * EPS * float(np.abs(self._rest / self._root / self._shift[name]).max(initial=0.0))

    def restore(self) -> None:
        """Put back the state of the bodies."""
        for name, column in self._columns.items():
            column[:] = self._kept[name]

    def _forces_at(self, name: str, by: Floats) -> Floats:
        """With the bodies shifted and turned by so much, or with their velocities changed."""
        self._columns[name][:] += by[: self._shifts].reshape(self._kept[name].shape)
        if len(self._spins):
            turn = np.einsum("bij,bj->bi", self._axes, by[self._shifts :].reshape(len(self._spins), -1))
            of = "rotation" if name == "position" else "spin.angular_velocity"
            start = self._kept[of][self._spins]
            quaternions = start.ndim == 2 and name == "position"
            self._columns[of][self._spins] = _turned(start, turn) if quaternions else start + turn.reshape(start.shape)
        forces = self._sum()
        self.restore()
        return forces

    def _sum(self) -> Floats:
        self._services.forces.evaluate(self._world.time)
        sums = self._columns["force"].ravel()
        if len(self._spins):
            torque = self._columns["torque"][self._spins].reshape(len(self._spins), -1)
            sums = np.append(sums, np.einsum("bij,bi->bj", self._axes, torque))
        for entity in self.entity[~np.isfinite(sums)][:1]:
            raise ValueError(f"entity {entity}: the forces on it are {sums[self.entity == entity].tolist()}")
        return sums / self._root


@contextmanager
def unmeasured(state: Record) -> Iterator[None]:
    """Stages that run inside leave no trace in what the world measures and in what it knows of its forces."""
    numbers, measured = {name: getattr(state, name) for name in FORCE_STATE}, (state.ticks.copy(), state.calls.copy())
    try:
        yield
    finally:
        for name, value in numbers.items():
            setattr(state, name, value)
        state.ticks[:], state.calls[:] = measured


def modes_of(world: World) -> Modes:
    """The stiffest and the most damped oscillators, all of at most ALL degrees of freedom. The world is as it was
    afterwards, to the bit. ValueError if the forces are not finite."""
    if not world.force_systems or not len(world.bodies.dynamic):
        return Modes(none := np.zeros(0), none, none, none)
    services: Any = world.physics
    services.refresh_for_queries()  # the stages see the bodies that there are
    with unmeasured(services.state), world:
        forces = Forces(world)
        try:
            forces.begin()
            changes = [partial(forces.change, name) for name in ("position", "linear_velocity")]
            bases = [np.eye(len(forces))] if len(forces) <= ALL else [_dominant(each, len(forces)) for each in changes]
            basis = np.linalg.qr(np.concatenate(bases, axis=1))[0]
            return _modes_in(basis, _images(changes[0], basis), _images(changes[1], basis), forces)
        finally:
            forces.restore()


def _dominant(change: Callable[[Floats], Floats], n: int) -> Floats:
    """(n, WIDTH): a basis of the largest modes, by power iteration of several vectors at once (Saad, Numerical Methods
    for Large Eigenvalue Problems, section 5.1)."""
    basis, largest = np.linalg.qr(np.random.default_rng(0).normal(size=(n, WIDTH)))[0], 0.0
    for _ in range(ROUNDS):
        image = _images(change, basis)
        before, largest = largest, float(np.abs(np.linalg.eigvals(basis.T @ image)).max())
        if abs(largest - before) <= CONVERGED * largest:
            break
        basis = np.linalg.qr(image)[0]
    return basis


def _images(change: Callable[[Floats], Floats], vectors: Floats) -> Floats:
    return np.stack([change(vector) for vector in vectors.T], axis=1)


def _modes_in(basis: Floats, by_stiffness: Floats, by_drag: Floats, forces: Forces) -> Modes:
    """The modes of x'' = -K x - (C + G) x' in the space of that basis (n, m), whose images under K and C are given.

    Their Rayleigh quotients k, c and g satisfy x'' = -k x - (c + g) x' exactly if the space holds the mode.
    """
    m, damping = basis.shape[1], forces.damping[:, None]
    lower = -basis.T @ np.concatenate((by_stiffness, by_drag + damping * basis), axis=1)
    small = np.linalg.eig(np.concatenate((np.eye(m, 2 * m, m), lower)))[1][:m]
    vectors = basis @ small
    weights = np.abs(vectors) ** 2
    k, c, g = ((np.conj(vectors) * (image @ small)).sum(axis=0) / weights.sum(axis=0)
               for image in (by_stiffness, by_drag, damping * basis))  # fmt: skip
    stiffest, fastest = float(np.abs(k).max()), float(np.abs(c).max())
    k = _cleaned(k, max(NOISE * stiffest, forces.noise("position")))
    c = _cleaned(c, max(NOISE * max(fastest, stiffest**0.5), forces.noise("linear_velocity")))
    return Modes(forces.entity[np.argmax(weights, axis=0)], k, c, g.real)


def _cleaned(values: Any, noise: float) -> Any:
    real, turning = (np.where(np.abs(part) > noise, part, 0.0) for part in (values.real, values.imag))
    return real + 1j * turning


def _principal(table: Any, entity: int) -> tuple[Floats, Floats]:
    """(a body's principal axes as columns along those of the world, its moments of inertia about them)."""
    spin = object.__new__(Spin)
    spin._bind(table, entity)
    moments = spin.moments
    if not np.ndim(moments):
        return np.eye(1), np.array([moments])
    principal, own = np.linalg.eigh(moments)
    principal = principal * (principal > 8 * EPS * principal[-1])
    return axes_of(table.column("rotation")[table.find(entity)]) @ own, principal


def _turned(rotation: Floats, turn: Floats) -> Floats:
    """Quaternions (n, 4), turned by small vectors (n, 3)."""
    w, u, half = rotation[:, :1], rotation[:, 1:], 0.5 * turn
    moved = np.concatenate((w - (half * u).sum(axis=1, keepdims=True), u + w * half + np.cross(half, u)), axis=1)
    return moved / np.linalg.norm(moved, axis=1, keepdims=True)


def _spacing(places: Any) -> float:
    """Typical distance between bodies, m; of a single one from the origin; else 1."""
    known = places[np.isfinite(places).all(axis=1)]
    wide = float(np.ptp(known, axis=0).max()) if len(known) else 0.0
    return wide / len(known) ** (1 / known.shape[1]) if wide else _largest(known) or 1.0


def _largest(values: Any) -> float:
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
