"""Passes over many rows at once, where bodies spin.

A chunk is some pairs of which no two share a body that moves: in any order they do the same. What their rows need of
the bodies is brought side by side, so that one instruction works on several rows, and taken back after all points of
the pairs are solved.
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, part
from ....framework.vectors import add, add_scaled, dot, item, replace, scale, sub
from ...integration.turning import cross_spin, symmetric, twist


@part
def find_chunks(solver, span):
    """The chunks of a range, which are behind those of the one before, and the masses of their bodies."""
    c = solver.end_chunk if span[0] > 0 else 0
    solver.first_chunk, start = c, span[0]
    while c < solver.chunks and solver.ends[c] <= span[1]:
        for k in range(start, start + (solver.ends[c] - start) // solver.points[c]):
            a, b = solver.first[k], solver.second[k]
            solver.mass_a[k], solver.mass_b[k] = solver.inverse_mass[a], solver.inverse_mass[b]
            solver.inertia_a[k], solver.products_a[k] = solver.inverse_inertia[a], solver.inverse_products[a]
            solver.inertia_b[k], solver.products_b[k] = solver.inverse_inertia[b], solver.inverse_products[b]
        start, c = solver.ends[c], c + 1
    solver.end_chunk = c


@part
def gather_chunk(solver, start, end):
    """Bring the motion of the bodies to the pairs of a chunk."""
    for k in range(start, end):
        a, b = solver.first[k], solver.second[k]
        solver.velocity_a[k], solver.spin_a[k] = solver.velocity[a], solver.spin[a]
        solver.velocity_b[k], solver.spin_b[k] = solver.velocity[b], solver.spin[b]


@part
def scatter_chunk(solver, start, end):
    """Take it back to those that move."""
    for k in range(start, end):
        if solver.mass_a[k] > 0.0:
            a = solver.first[k]
            solver.velocity[a], solver.spin[a] = solver.velocity_a[k], solver.spin_a[k]
        if solver.mass_b[k] > 0.0:
            b = solver.second[k]
            solver.velocity[b], solver.spin[b] = solver.velocity_b[k], solver.spin_b[k]


@inlined
def is_chunk_held(old, slip, normal, mass, limit):
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
def solve_rows(solver, bias, pushes, start, end, ahead):
    """The rows of one point of the pairs of a chunk, ``ahead`` of those of the first one, without a branch for single
    ones: each along its normal, then along its surface."""
    for q in range(start, end):
        k = q + ahead
        n, arm_a, arm_b = solver.normal[k], solver.arm_a[k], solver.arm_b[k]
        w_a, w_b = solver.mass_a[q], solver.mass_b[q]
        d_a, p_a, d_b, p_b = solver.inertia_a[q], solver.products_a[q], solver.inertia_b[q], solver.products_b[q]
        v_a, s_a, v_b, s_b = solver.velocity_a[q], solver.spin_a[q], solver.velocity_b[q], solver.spin_b[q]
        old, tangent = solver.impulse[k], solver.tangent[k]
        parting = sub(add(v_b, cross_spin(s_b, arm_b)), add(v_a, cross_spin(s_a, arm_a)))
        excess = solver.mass[k] * (-dot(parting, n) - bias[k])
        if pushes:
            excess -= solver.soft[k] * (excess + old)
        new = old + excess if old + excess > 0.0 else 0.0
        solver.impulse[k], push = new, scale(n, new - old)
        v_a, s_a = add_scaled(v_a, push, -w_a), sub(s_a, symmetric(d_a, p_a, twist(arm_a, push)))
        v_b, s_b = add_scaled(v_b, push, w_b), add(s_b, symmetric(d_b, p_b, twist(arm_b, push)))
        slip = sub(add(v_b, cross_spin(s_b, arm_b)), add(v_a, cross_spin(s_a, arm_a)))
        pull = is_chunk_held(tangent, slip, n, solver.tangent_mass[k], solver.friction[k] * new)
        solver.tangent[k], push = pull, sub(pull, tangent)
        solver.velocity_a[q] = add_scaled(v_a, push, -w_a)
        solver.spin_a[q] = sub(s_a, symmetric(d_a, p_a, twist(arm_a, push)))
        solver.velocity_b[q] = add_scaled(v_b, push, w_b)
        solver.spin_b[q] = add(s_b, symmetric(d_b, p_b, twist(arm_b, push)))


@part
def solve_chunks(solver, bias, pushes, span):
    """One pass over the rows of a range. bias, pushes: see ``solve_normals``."""
    start = span[0]
    for c in range(solver.first_chunk, solver.end_chunk):
        points = solver.points[c]
        pairs = (solver.ends[c] - start) // points
        gather_chunk(solver, start, start + pairs)
        for e in range(points):
            solve_rows(solver, bias, pushes, start, start + pairs, e * pairs)
        scatter_chunk(solver, start, start + pairs)
        start = solver.ends[c]
