"""Surfaces that run, as those of conveyor belts."""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.vectors import add, item, replace, sub


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
def slip_of(state, a, b, velocity):
    """The velocity of the surface of b as that of a sees it, where the bodies' own is ``velocity``."""
    if not any_surface_runs(state):
        return velocity
    surface, slot = state.colliders.surface_velocity, state.bodies.collider_slot
    one, other = along_world(state, a, surface[slot[a], a]), along_world(state, b, surface[slot[b], b])
    return add(velocity, sub(other, one))
