"""Stiffness of a world's forces in the present state: the oscillators that they form with the bodies.

The changes of the forces for small shifts of the bodies, and for small changes of their velocities, give the matrices
of stiffness and drag, each divided by the masses. Their modes are independent oscillators x'' = -k x - c x'. The world
is left unchanged, bit for bit; force systems are evaluated several times, which they must allow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from ...framework import World
from ...framework.jit.records.record import Record
from .stability import Complexes, Floats

EPS = float(np.finfo(float).eps)
SHIFT = 1e-5  # relative to the distance between bodies, and to their speed
FARTHEST = 1e-8  # relative to the coordinates: smaller shifts would be lost to rounding far from the origin
KINK = 0.01  # a relative difference above this between forward and backward shifts means a kink in the force
NOISE = 1e-7  # relative to the largest of its kind: smaller values are rounding
DENSE = 2000  # degrees of freedom up to which every one is shifted alone
BLOCK = 300  # degrees of freedom of coupled bodies up to which all modes are found
KRYLOV = 60  # directions tried if only the stiffest and the most damped modes are computed
SOUGHT = 20  # number of these modes

# What summing forces changes in the state beside the columns.
FORCE_STATE = ("stage", "force_evaluations", "pushed", "unforced", "forces_summed")

Apply: TypeAlias = Callable[[Floats], Floats]


@dataclass(frozen=True)
class Modes:
    """Oscillators x'' = -stiffness x - (drag + damping) x', each (m,).

    entity: the body with the largest amplitude
    stiffness, drag: 1/s^2 and 1/s, by forces; complex if forces turn the motion
    damping: 1/s, linear_damping
    coupled: (stiffness, drag, damping) of groups of bodies whose stiffness and drag do not commute
    """

    entity: np.ndarray
    stiffness: Complexes
    drag: Complexes
    damping: Floats
    coupled: list[tuple[Floats, Floats, Floats]]


class Forces:
    """The forces of a world's dynamic bodies as functions of their state: see :func:`forces_of`.

    Vectors have one number per degree of freedom, times the root of its mass, so that the matrices of forces with a
    potential are symmetric.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._services: Any = world.physics
        bodies = world.bodies.dynamic
        self.entity = np.array(bodies.entity)
        self.damping = np.repeat(np.array(bodies.linear_damping), world.dimensions or 0)
        self._columns = {name: getattr(bodies, name) for name in ("position", "linear_velocity", "force")}
        self._kept = {name: column.copy() for name, column in self._columns.items()}
        self._root = np.sqrt(np.repeat(bodies.mass, world.dimensions or 0))
        position, velocity = (_finite(self._kept[name]) for name in ("position", "linear_velocity"))
        length = _spacing(position, _finite(world.bodies.position))
        self._shift = {
            "position": _power_of_two(max(SHIFT * length, FARTHEST * float(np.abs(position).max(initial=0.0)))),
            "linear_velocity": _power_of_two(SHIFT * (float(np.abs(velocity).max(initial=0.0)) or length)),
        }

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
        return 8 * EPS * float(np.abs(self._rest / self._root).max(initial=0.0)) / self._shift[name]

    def _answer(self, name: str, direction: Floats) -> Floats:
        column, start = self._columns[name], self._kept[name]
        moved = direction / self._root
        largest = float(np.abs(moved).max())
        if largest == 0.0:
            return np.zeros(len(self))
        scale = self._shift[name] / largest
        answers = []
        for sign in (1.0, -1.0):
            column[:] = start + (sign * scale * moved).reshape(start.shape)
            answers.append(-sign * (self._sum() - self._rest) / scale)
        column[:] = start
        there, back = answers
        if np.abs(there - back).max() > KINK * max(np.abs(there).max(), np.abs(back).max()):
            return max(there, back, key=lambda answer: float(np.abs(answer).max()))  # a rope: take the taut side
        return (there + back) / 2

    def _sum(self) -> Floats:
        self._services.forces.evaluate(self._world.time)
        force = self._columns["force"]
        bad = np.flatnonzero(~np.isfinite(force).all(axis=1))
        if len(bad):
            raise ValueError(f"entity {self.entity[bad[0]]}: the forces on it are {force[bad[0]].tolist()}")
        return force.ravel() / self._root


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
    """The oscillators that the force systems of ``world`` form with its dynamic bodies, in the present state.

    All modes of coupled bodies with up to 300 degrees of freedom; with more, the stiffest and the most damped ones.
    ValueError if the forces are not finite.
    """
    if not world.force_systems or not len(world.bodies.dynamic):
        return _joined([])
    with forces_of(world) as forces:
        if len(forces) > DENSE:
            return _joined([_extreme(forces.stiffness, forces.drag, np.arange(len(forces)), forces)])
        unit = np.eye(len(forces))
        stiffness, drag = (np.stack([ask(e) for e in unit], axis=1) for ask in (forces.stiffness, forces.drag))
        parts = []
        for rows in _groups((stiffness != 0) | (drag != 0)):
            block = np.ix_(rows, rows)
            parts.append(_of_block(stiffness[block], drag[block], rows, forces))
        return _joined(parts)


def _of_block(k: Floats, c: Floats, rows: np.ndarray, forces: Forces) -> Modes:
    """All modes of a group of coupled bodies; of a large group, the extreme ones."""
    n, damping = len(rows), forces.damping[rows]
    if n > BLOCK:
        return _extreme(lambda u: k @ u, lambda u: c @ u, rows, forces)
    even = not np.ptp(damping)
    symmetric = np.abs(k - k.T).max() <= NOISE * np.abs(k).max()
    if not c.any() and even:
        vectors: Any = np.linalg.eigh((k + k.T) / 2)[1] if symmetric else np.linalg.eig(k)[1]
    else:
        upper = np.concatenate((np.zeros((n, n)), np.eye(n)), axis=1)
        lower = np.concatenate((-k, -c - np.diag(damping)), axis=1)
        vectors = np.linalg.eig(np.concatenate((upper, lower)))[1][:n]
    found = _quotients(vectors, k @ vectors, c @ vectors, rows, forces)
    apart = _apart(k, c) or (not even and _apart(k, np.diag(damping))) or (not even and _apart(c, np.diag(damping)))
    if apart:
        found.coupled.append((k, c, damping))
    return found


def _extreme(stiffness: Apply, drag: Apply, rows: np.ndarray, forces: Forces) -> Modes:
    """The stiffest and the most damped modes, from the Krylov spaces of both matrices."""
    parts = []
    for apply in (stiffness, drag):
        vectors = _extreme_vectors(apply, len(rows))
        if vectors.shape[1]:
            k, c = (np.stack([_of_complex(ask, v) for v in vectors.T], axis=1) for ask in (stiffness, drag))
            parts.append(_quotients(vectors, k, c, rows, forces))
    return _joined(parts)


def _extreme_vectors(apply: Apply, n: int) -> Any:
    """(n, m): Ritz vectors of the largest eigenvalues, by Arnoldi's method (Saad, Numerical Methods for Large
    Eigenvalue Problems, section 6.2)."""
    start = np.random.default_rng(0).normal(size=n)
    basis, matrix = [start / np.linalg.norm(start)], np.zeros((KRYLOV + 1, KRYLOV))
    for j in range(min(KRYLOV, n)):
        image = apply(basis[j])
        size = float(np.linalg.norm(image))
        for _ in range(2):  # repeated: rounding leaves a remainder
            for i, vector in enumerate(basis):
                share = float(vector @ image)
                matrix[i, j] += share
                image = image - share * vector
        rest = float(np.linalg.norm(image))
        if rest <= 1e-9 * size or size == 0.0:
            break
        matrix[j + 1, j] = rest
        basis.append(image / rest)
    m = j + 1
    values, small = np.linalg.eig(matrix[:m, :m])
    chosen = np.argsort(-np.abs(values), kind="stable")[:SOUGHT]
    chosen = chosen[np.abs(values[chosen]) > 0]
    return np.stack(basis[:m], axis=1) @ small[:, chosen]


def _of_complex(apply: Apply, vector: Any) -> Any:
    real = apply(np.ascontiguousarray(vector.real)) + 0j
    return real + 1j * apply(np.ascontiguousarray(vector.imag)) if np.iscomplexobj(vector) else real


def _quotients(vectors: Any, by_stiffness: Any, by_drag: Any, rows: np.ndarray, forces: Forces) -> Modes:
    """Rayleigh quotients of each mode (n, m), with which it satisfies x'' = -k x - c x' exactly."""
    weights = np.abs(vectors) ** 2
    squares = weights.sum(axis=0)
    k, c = ((np.conj(vectors) * image).sum(axis=0) / squares for image in (by_stiffness, by_drag))
    g = (weights * forces.damping[rows][:, None]).sum(axis=0) / squares
    stiffest, fastest = float(np.abs(k).max(initial=0.0)), float(np.abs(c).max(initial=0.0))
    k = _cleaned(k, max(NOISE * stiffest, forces.noise("position")))
    c = _cleaned(c, max(NOISE * max(fastest, stiffest**0.5), forces.noise("linear_velocity")))
    dimensions = len(forces.damping) // len(forces.entity)
    return Modes(forces.entity[rows[np.argmax(weights, axis=0)] // dimensions], k, c, g, [])


def _cleaned(values: Any, noise: float) -> Complexes:
    values = values + 0j
    return np.where(np.abs(values.real) > noise, values.real, 0.0) + 1j * np.where(
        np.abs(values.imag) > noise, values.imag, 0.0
    )


def _apart(one: Floats, other: Floats) -> bool:
    """True if two matrices do not share their modes, that is, do not commute."""
    return bool(np.abs(one @ other - other @ one).max() > 1e-5 * np.abs(one).max() * np.abs(other).max())


def _groups(linked: np.ndarray) -> Iterator[np.ndarray]:
    """Rows of coupled degrees of freedom, each group sorted."""
    linked, left = linked | linked.T, set(range(len(linked)))
    while left:
        first = left.pop()
        group, edge = [first], [first]
        while edge:
            near = [row for row in np.flatnonzero(linked[edge.pop()]).tolist() if row in left]
            left.difference_update(near)
            group += near
            edge += near
        yield np.array(sorted(group))


def _joined(parts: list[Modes]) -> Modes:
    """All parts together; equal oscillators are merged."""
    if not parts:
        return Modes(np.empty(0, np.int64), np.empty(0, complex), np.empty(0, complex), np.empty(0), [])
    entity = np.concatenate([part.entity for part in parts])
    k = np.concatenate([part.stiffness for part in parts])
    c = np.concatenate([part.drag for part in parts])
    g = np.concatenate([part.damping for part in parts])
    keys = np.stack([k.real, np.abs(k.imag), c.real, np.abs(c.imag), g], axis=1)
    with np.errstate(divide="ignore"):
        digits = np.where(keys == 0, 0.0, np.floor(np.log10(np.abs(keys))) - 8)
    order = np.argsort(entity, kind="stable")
    first = order[np.unique(np.round(keys / 10.0**digits)[order] * 10.0 ** digits[order], axis=0, return_index=True)[1]]
    first.sort()
    return Modes(entity[first], k[first], c[first], g[first], [group for part in parts for group in part.coupled])


def _spacing(dynamic: Floats, everything: Floats) -> float:
    """Typical distance between bodies, m; for a single body its distance from the origin; else 1."""
    for places in (dynamic, everything):
        wide = float(np.ptp(places, axis=0).max()) if len(places) else 0.0
        if wide > 0.0:
            return wide / len(places) ** (1 / places.shape[1])
    return float(np.abs(dynamic).max(initial=0.0)) or 1.0


def _finite(rows: Floats) -> Floats:
    return rows[np.isfinite(rows).all(axis=1)]


def _power_of_two(value: float) -> float:
    return float(2.0 ** np.round(np.log2(value)))
