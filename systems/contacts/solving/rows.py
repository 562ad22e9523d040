"""Rows of the solver: points where two bodies touch. How a row moves its bodies stands here, and nowhere else.

What a round body that spins adds along the surface is in :mod:`turning`.
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, part
from ....framework.vectors import add, add_scaled, dot, scale, sub
from ...integration.turning import surface_velocity, turn_by, turning_mass


@inlined
def effective_mass(solver, k):
    """The mass that an impulse along row k moves."""
    return 1.0 / (solver.inverse_mass[solver.first[k]] + solver.inverse_mass[solver.second[k]])


@inlined
def relative_velocity(solver, k):
    """The velocity of the second body of row k, as the first one sees it."""
    return sub(solver.velocity[solver.second[k]], solver.velocity[solver.first[k]])


@inlined
def closing_speed(solver, k):
    """The speed at which the bodies of row k approach each other along its normal."""
    return -dot(relative_velocity(solver, k), solver.normal[k])


@inlined
def apply_impulse(solver, k, impulse):
    """Push the second body of row k by an impulse, a vector, and the first one back."""
    velocity, inverse_mass = solver.velocity, solver.inverse_mass
    a, b = solver.first[k], solver.second[k]
    v_a, v_b, w_a, w_b = velocity[a], velocity[b], inverse_mass[a], inverse_mass[b]
    if w_a > 0.0:  # storing what stays as it is would make rows with one floor wait for each other
        velocity[a] = add_scaled(v_a, impulse, -w_a)
    if w_b > 0.0:
        velocity[b] = add_scaled(v_b, impulse, w_b)


@part
def solve_normals(solver, bias, softness, pushes, start, stop):
    """One pass over the rows from start to stop, along their normals.

    bias: speed at which each row may close, below 0 at which it is to open. softness: (share of that speed which a soft
    row takes, share of its impulse that it gives back), where this pass ``pushes``.
    """
    impulse, soft = solver.impulse, solver.soft
    mass_scale, impulse_scale = softness
    for k in range(start, stop):
        old = impulse[k]
        excess = solver.mass[k] * (closing_speed(solver, k) - bias[k])
        if pushes and soft[k]:
            excess = mass_scale * excess - impulse_scale * old
        new = max(0.0, old + excess)
        apply_impulse(solver, k, scale(solver.normal[k], new - old))
        impulse[k] = new


@inlined
def solve_friction_of(solver, k):
    """Stop what slides at row k, with at most ``friction`` times the normal impulse (Coulomb)."""
    n, old, w, mass = solver.normal[k], solver.tangent[k], relative_velocity(solver, k), solver.mass[k]
    a, b = solver.first[k], solver.second[k]
    if solver.spinning:
        w = add(add(w, solver.carried[k]), surface_velocity(solver, a, b, n))
        mass = 1.0 / (1.0 / mass + turning_mass(solver, a, b))
    pull = add_scaled(old, add_scaled(w, n, -dot(w, n)), -mass)
    strength, limit = math.sqrt(dot(pull, pull)), solver.friction[k] * solver.impulse[k]
    if strength > limit:
        pull = scale(pull, limit / strength)
    solver.tangent[k] = pull
    apply_impulse(solver, k, sub(pull, old))
    if solver.spinning:
        turn_by(solver, a, b, n, sub(pull, old))


@part
def solve_friction(solver, start, stop):
    """One pass over the rows from start to stop, along their surfaces."""
    for k in range(start, stop):
        if solver.friction[k] != 0.0:
            solve_friction_of(solver, k)


@part
def relax_listed(solver, count):
    """One pass over the first rows of ``listed``, which may close as fast as what is open lets them."""
    for e in range(count):
        k = solver.listed[e]
        old = solver.impulse[k]
        new = max(0.0, old + solver.mass[k] * (closing_speed(solver, k) - solver.opening[k]))
        apply_impulse(solver, k, scale(solver.normal[k], new - old))
        solver.impulse[k] = new
        if solver.friction[k] != 0.0:
            solve_friction_of(solver, k)
    solver.visits += count
