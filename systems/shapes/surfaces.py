"""Surfaces that run, as those of conveyor belts."""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.vectors import add, item, negative, replace, sub
from .linking.mixing import has_material, material_at


@part
def along_world(state, i, local):
    """A vector along the axes of body i, as it is in the world."""
    axes, d, result = state.bodies.axes, len(local), local
    for k in range(d if state.rotated else 0):
        total = 0.0
        for j in range(d):
            total += axes[(i * d + k) * d + j] * item(local, j)
        result = replace(result, k, total)
    return result


@part
def any_surface_runs(state):
    """Whether some collider has, or had, a surface velocity."""
    return len(state.colliders.surface_velocity) > 0


@part
def surface_velocity_at(state, i, point, normal):
    """At which the surface of body i runs, along the axes of the world, where some surface runs.

    point, normal: of the surface, from the centre of its shape, leading away
    """
    local = state.colliders.surface_velocity[state.bodies.collider_slot[i], i]
    if has_material(state, i):
        there = material_at(state, i, point, normal)[2]
        if item(there, 0) == item(there, 0):
            local = there
    return along_world(state, i, local)


@part
def slip_at(state, a, b, velocity, touch):
    """The velocity of the surface of b as that of a sees it, where the bodies' own is ``velocity``; touch: as for
    :func:`restitution_at`."""
    if not any_surface_runs(state):
        return velocity
    point, normal, apart = touch
    one = surface_velocity_at(state, a, point, normal)
    return add(velocity, sub(surface_velocity_at(state, b, sub(point, apart), negative(normal)), one))
