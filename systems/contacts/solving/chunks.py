"""Many rows at once, where bodies spin.

A chunk is some pairs of which no two share a body that moves: in any order they do the same. What their rows need of
the bodies is brought side by side, so that one instruction works on several rows, and taken back after all points of
the pairs are solved.
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, part
from ....framework.jit.records.schema import Schema, vectors
from ....framework.jit.records.stack_record import stack_record
from ....framework.vectors import add, add_scaled, dot, item, replace, scale, sub
from ...integration.turning import cross_spin, symmetric, twist
from .records import ROW_CHUNK

FEW_ROWS = 6  # rows of a chunk: fewer are as fast one by one, with the same bits

# What the rows of a chunk need of the bodies of its pairs.
CHUNK = Schema(
    "Chunk",
    unshared=True,
    velocity_a=vectors(apart=True, unit="m/s"),
    velocity_b=vectors(apart=True, unit="m/s"),
    spin_a=vectors(apart=True, flat=1, unit="rad/s"),
    spin_b=vectors(apart=True, flat=1, unit="rad/s"),
)
make_chunk = stack_record(CHUNK, ROW_CHUNK)


@part
def find_chunks(solver, span):
    """The chunks of a range, which are behind those of the one before."""
    c = solver.end_chunk if span[0] > 0 else 0
    solver.first_chunk = c
    while c < solver.chunks and solver.ends[c] <= span[1]:
        c += 1
    solver.end_chunk = c


@inlined
def has_chunks(solver, span):
    """Whether the chunks of a range have many rows."""
    return (solver.end_chunk - solver.first_chunk) * FEW_ROWS < span[1] - span[0]


@part
def load_masses(solver, span):
    """The masses of the bodies of the pairs of a range, where its rows are solved by chunks."""
    start = span[0]
    for c in range(solver.first_chunk, solver.end_chunk if has_chunks(solver, span) else solver.first_chunk):
        for k in range(start, start + (solver.ends[c] - start) // solver.points[c]):
            a, b = solver.first[k], solver.second[k]
            solver.mass_a[k], solver.mass_b[k] = solver.inverse_mass[a], solver.inverse_mass[b]
            solver.inertia_a[k], solver.products_a[k] = solver.inverse_inertia[a], solver.inverse_products[a]
            solver.inertia_b[k], solver.products_b[k] = solver.inverse_inertia[b], solver.inverse_products[b]
        start = solver.ends[c]


@inlined
def gather_motion(solver, chunk, start, pairs):
    """Bring the velocities of the bodies to the pairs of a chunk."""
    for q in range(pairs):
        a, b = solver.first[start + q], solver.second[start + q]
        chunk.velocity_a[q], chunk.spin_a[q] = solver.velocity[a], solver.spin[a]
        chunk.velocity_b[q], chunk.spin_b[q] = solver.velocity[b], solver.spin[b]


@inlined
def scatter_motion(solver, chunk, start, pairs):
    """Take them back to those that move."""
    for q in range(pairs):
        k = start + q
        if solver.mass_a[k] > 0.0:
            a = solver.first[k]
            solver.velocity[a], solver.spin[a] = chunk.velocity_a[q], chunk.spin_a[q]
        if solver.mass_b[k] > 0.0:
            b = solver.second[k]
            solver.velocity[b], solver.spin[b] = chunk.velocity_b[q], chunk.spin_b[q]


@inlined
def chunk_motion(chunk, q):
    """Velocities and spins of the bodies of pair q."""
    return chunk.velocity_a[q], chunk.spin_a[q], chunk.velocity_b[q], chunk.spin_b[q]


@inlined
def keep_motion(chunk, q, motion):
    """They change to these."""
    chunk.velocity_a[q], chunk.spin_a[q], chunk.velocity_b[q], chunk.spin_b[q] = motion


@inlined
def parting_at(motion, arm_a, arm_b):
    """The velocity of the second body at a point, as the first one sees it there."""
    v_a, s_a, v_b, s_b = motion
    return sub(add(v_b, cross_spin(s_b, arm_b)), add(v_a, cross_spin(s_a, arm_a)))


@inlined
def pushed(solver, k, motion, arm_a, arm_b, push):
    """The motion of the pair whose first row is k after an impulse at a point."""
    v_a, s_a, v_b, s_b = motion
    v_a = add_scaled(v_a, push, -solver.mass_a[k])
    s_a = sub(s_a, symmetric(solver.inertia_a[k], solver.products_a[k], twist(arm_a, push)))
    v_b = add_scaled(v_b, push, solver.mass_b[k])
    s_b = add(s_b, symmetric(solver.inertia_b[k], solver.products_b[k], twist(arm_b, push)))
    return v_a, s_a, v_b, s_b


@inlined
def pull_in_chunk(old, slip, normal, mass, limit):
    """The impulse along the surface that stops a slip, of at most ``limit``, where it is ``old`` so far."""
    if len(normal) == 2:  # a number along the one direction there is
        along = replace(replace(normal, 0, -item(normal, 1)), 1, item(normal, 0))
        pull = dot(old, along) - mass * dot(slip, along)
        pull = pull if pull < limit else limit
        return scale(along, pull if pull > -limit else -limit)
    pull = add_scaled(old, add_scaled(slip, normal, -dot(slip, normal)), -mass)
    square = dot(pull, pull)
    return scale(pull, limit / math.sqrt(square) if square > limit * limit else 1.0)


@part
def solve_rows(solver, chunk, bias, pushes, start, pairs, ahead):
    """The rows of one point of the pairs of a chunk, ``ahead`` of those of the first one, without a branch for single
    ones: along their normals, then along their surfaces. In two loops less waits for what is before it."""
    for q in range(pairs):
        k = start + q + ahead
        n, arm_a, arm_b, motion = solver.normal[k], solver.arm_a[k], solver.arm_b[k], chunk_motion(chunk, q)
        old = solver.impulse[k]
        excess = solver.mass[k] * (-dot(parting_at(motion, arm_a, arm_b), n) - bias[k])
        if pushes:
            excess -= solver.soft[k] * (excess + old)
        new = old + excess if old + excess > 0.0 else 0.0
        solver.impulse[k] = new
        keep_motion(chunk, q, pushed(solver, start + q, motion, arm_a, arm_b, scale(n, new - old)))
    for q in range(pairs if solver.has_friction else 0):
        k = start + q + ahead
        arm_a, arm_b, old, motion = solver.arm_a[k], solver.arm_b[k], solver.tangent[k], chunk_motion(chunk, q)
        slip, limit = parting_at(motion, arm_a, arm_b), solver.friction[k] * solver.impulse[k]
        pull = pull_in_chunk(old, slip, solver.normal[k], solver.tangent_mass[k], limit)
        solver.tangent[k] = pull
        keep_motion(chunk, q, pushed(solver, start + q, motion, arm_a, arm_b, sub(pull, old)))


@part
def solve_chunks(solver, bias, pushes, span):
    """One pass over the rows of a range. bias, pushes: see ``solve_normals``."""
    start, chunk = span[0], make_chunk(scale(solver.velocity[0], 0.0))
    for c in range(solver.first_chunk, solver.end_chunk):
        points = solver.points[c]
        pairs = (solver.ends[c] - start) // points
        gather_motion(solver, chunk, start, pairs)
        for e in range(points):
            solve_rows(solver, chunk, bias, pushes, start, pairs, e * pairs)
        scatter_motion(solver, chunk, start, pairs)
        start = solver.ends[c]
