"""Passes over many rows at once, where bodies spin.

A chunk is some rows behind each other of which no two share a body that moves: in any order they do the same. What
they need of their bodies is brought side by side, so that one instruction works on several rows, and taken back after.
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, part
from ....framework.vectors import add, add_scaled, dot, item, replace, scale, sub
from ...integration.turning import cross_spin, symmetric, twist

CHUNK = 64  # rows at most: their columns stay in the processor's first cache


@part
def find_chunks(solver, span):
    """Where each chunk of a range ends, and what its bodies weigh."""
    last_row, chunks, first = solver.used, 0, span[0]
    for q in range(solver.bodies):
        last_row[q] = -1
    for k in range(span[0], span[1]):
        a, b = solver.first[k], solver.second[k]
        w_a, w_b = solver.inverse_mass[a], solver.inverse_mass[b]
        if (w_a > 0.0 and last_row[a] >= first) or (w_b > 0.0 and last_row[b] >= first) or k - first == CHUNK:
            solver.ends[chunks], first = k, k
            chunks += 1
        last_row[a] = last_row[b] = k
        solver.mass_a[k], solver.mass_b[k] = w_a, w_b
        solver.inertia_a[k], solver.products_a[k] = solver.inverse_inertia[a], solver.inverse_products[a]
        solver.inertia_b[k], solver.products_b[k] = solver.inverse_inertia[b], solver.inverse_products[b]
    solver.ends[chunks] = span[1]
    solver.chunks = chunks + 1


@part
def gather(solver, start, end):
    """Bring the motion of the bodies to the rows of a chunk."""
    for k in range(start, end):
        a, b = solver.first[k], solver.second[k]
        solver.velocity_a[k], solver.spin_a[k] = solver.velocity[a], solver.spin[a]
        solver.velocity_b[k], solver.spin_b[k] = solver.velocity[b], solver.spin[b]


@part
def scatter(solver, start, end):
    """Take it back to those that move."""
    for k in range(start, end):
        if solver.mass_a[k] > 0.0:
            a = solver.first[k]
            solver.velocity[a], solver.spin[a] = solver.velocity_a[k], solver.spin_a[k]
        if solver.mass_b[k] > 0.0:
            b = solver.second[k]
            solver.velocity[b], solver.spin[b] = solver.velocity_b[k], solver.spin_b[k]


@inlined
def held(old, slip, normal, mass, limit):
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
def solve_rows(solver, bias, pushes, start, end):
    """The rows of a chunk, without a branch for single ones: each along its normal, then along its surface."""
    for k in range(start, end):
        n, arm_a, arm_b = solver.normal[k], solver.arm_a[k], solver.arm_b[k]
        w_a, w_b = solver.mass_a[k], solver.mass_b[k]
        d_a, p_a, d_b, p_b = solver.inertia_a[k], solver.products_a[k], solver.inertia_b[k], solver.products_b[k]
        v_a, s_a, v_b, s_b = solver.velocity_a[k], solver.spin_a[k], solver.velocity_b[k], solver.spin_b[k]
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
        pull = held(tangent, slip, n, solver.tangent_mass[k], solver.friction[k] * new)
        solver.tangent[k], push = pull, sub(pull, tangent)
        solver.velocity_a[k] = add_scaled(v_a, push, -w_a)
        solver.spin_a[k] = sub(s_a, symmetric(d_a, p_a, twist(arm_a, push)))
        solver.velocity_b[k] = add_scaled(v_b, push, w_b)
        solver.spin_b[k] = add(s_b, symmetric(d_b, p_b, twist(arm_b, push)))


@part
def solve_chunks(solver, bias, pushes, span):
    """One pass over the rows of a range. bias, pushes: see ``solve_normals``."""
    start = span[0]
    for c in range(solver.chunks):
        end = solver.ends[c]
        gather(solver, start, end)
        solve_rows(solver, bias, pushes, start, end)
        scatter(solver, start, end)
        start = end
