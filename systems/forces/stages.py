"""The stages of FORCES: velocities within their limits, then gravity, constant and applied forces."""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, item, replace, scale
from ..codes import NEED_ROOM


@part
def within(point, origin, limit):
    """The point itself, or on the way to it what is ``limit`` metres from the origin (nan: no limit).

    Scaled by the largest component, so that no square overflows.
    """
    largest = 0.0
    for k in range(len(point)):
        largest = max(largest, abs(item(point, k) - item(origin, k)))
    if limit != limit or largest == 0.0 or not math.isfinite(largest):
        return point
    square = 0.0
    for k in range(len(point)):
        ratio = (item(point, k) - item(origin, k)) / largest
        square += ratio * ratio
    length = math.sqrt(square)
    if length > limit / largest:
        for k in range(len(point)):
            start = item(origin, k)
            point = replace(point, k, start + (item(point, k) - start) / largest * (limit / length))
    return point


def limit_velocities(state, dt):
    """Shorten the velocities of the dynamic bodies that exceed their max_linear_speed."""
    if state.limits_speed:
        bodies, zero = state.bodies, zero_of(state)
        for i in range(state.first, state.dynamic):
            if not bodies.quarantined[i]:
                bodies.linear_velocity[i] = within(bodies.linear_velocity[i], zero, bodies.max_linear_speed[i])
    return 0


@part
def is_zero(vector):
    """Whether every component is 0."""
    zero = True
    for k in range(len(vector)):
        zero &= item(vector, k) == 0.0
    return zero


@part
def any_nonzero(state, vectors):
    """Whether some vector of a column on demand is not 0, of a dynamic body that takes part."""
    out, found = state.bodies.quarantined, False
    for i in range(state.force_first, state.dynamic if len(vectors) > 0 else 0):
        found |= (not is_zero(vectors[i])) & (not out[i])
    return found


def sum_forces(state, dt):
    """force = m g s + the constant force + what was applied; nothing is summed where nothing acts."""
    bodies, first, dynamic, gravity = state.bodies, state.force_first, state.dynamic, state.gravity[0]
    force, applied, for_step = bodies.force, bodies.applied_force, bodies.step_force
    state.forces_summed = True
    if dynamic == 0:
        return 0
    pushed = any_nonzero(state, applied) or any_nonzero(state, for_step)
    given = pushed or state.has_force_systems or not is_zero(gravity) or any_nonzero(state, bodies.constant_force)
    if not given:
        for i in range(first, dynamic if any_nonzero(state, force) else 0):
            force[i] = zero_of(state)
        state.unforced, state.pushed = True, False
        return 0
    if len(force) == 0:
        state.needed = state.count
        return NEED_ROOM
    state.force_evaluations += 1
    mass, gravity_scale, constant = bodies.mass, bodies.gravity_scale, bodies.constant_force
    for i in range(first, dynamic):
        force[i] = add(scale(gravity, mass[i] * gravity_scale[i]), constant[i])
    for i in range(first, dynamic if pushed else 0):
        force[i] = add(add(force[i], applied[i]), for_step[i])
    state.pushed = pushed
    return 0
