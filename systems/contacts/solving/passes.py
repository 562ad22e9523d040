"""One pass of the solver over the contacts: along their normals, and along their surfaces."""

from __future__ import annotations

import math

from ....framework.compilation import part
from ....framework.vectors import add_scaled, dot, scale, sub


@part
def solve_friction(solver, chosen):
    """Stop what slides, with at most ``friction`` times the normal impulse (Coulomb). chosen: only active ones."""
    velocity, inverse_mass, tangent, normal = solver.velocity, solver.inverse_mass, solver.tangent, solver.normal
    for k in range(solver.contacts):
        if solver.friction[k] == 0.0 or (chosen and not solver.active[k]):
            continue
        a, b, n, old = solver.first[k], solver.second[k], normal[k], tangent[k]
        w = sub(velocity[b], velocity[a])
        pull = add_scaled(old, add_scaled(w, n, -dot(w, n)), -solver.mass[k])
        strength, limit = math.sqrt(dot(pull, pull)), solver.friction[k] * solver.impulse[k]
        if strength > limit:
            pull = scale(pull, limit / strength)
        tangent[k] = pull
        change = sub(pull, old)
        velocity[a] = add_scaled(velocity[a], change, -inverse_mass[a])
        velocity[b] = add_scaled(velocity[b], change, inverse_mass[b])


@part
def solve_normals(solver, bias, softness, pushes, chosen):
    """One pass over the contacts, those in blocks left out.

    softness: (share of the speed asked for that a soft contact takes, share of its impulse that it gives back), where
    this pass ``pushes``. chosen: only active contacts.
    """
    velocity, inverse_mass, impulse, mass = solver.velocity, solver.inverse_mass, solver.impulse, solver.mass
    first, second, normal = solver.first, solver.second, solver.normal
    in_block, active, soft = solver.in_block, solver.active, solver.soft
    mass_scale, impulse_scale = softness
    for k in range(solver.contacts):
        if in_block[k] or (chosen and not active[k]):
            continue
        a, b, n, old = first[k], second[k], normal[k], impulse[k]
        v_a, v_b = velocity[a], velocity[b]
        wanted = mass[k] * (dot(sub(v_b, v_a), n) + bias[k])
        if pushes and soft[k]:
            wanted = mass_scale * wanted + impulse_scale * old
        new = max(0.0, old - wanted)
        impulse[k] = new
        # Storing what stays as it is would make contacts with one floor wait for each other.
        if inverse_mass[a] > 0.0:
            velocity[a] = add_scaled(v_a, n, (old - new) * inverse_mass[a])
        if inverse_mass[b] > 0.0:
            velocity[b] = add_scaled(v_b, n, (new - old) * inverse_mass[b])
