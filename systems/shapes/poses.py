"""Shapes as they are turned: what reads the axes of a body sees these."""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, item, length, replace
from ..integration.turning import turn_of_arm
from .dispatch import write_rotated


@part
def turn_shape(state, i, angle):
    """The shape of body i is turned by an angle, about the body's position."""
    bodies, axes, d = state.bodies, state.bodies.axes, len(angle)
    if len(axes) == 0 or length(angle) == 0.0:
        return
    for j in range(d):
        axis = zero_of(state)
        for k in range(d):
            axis = replace(axis, k, axes[(i * d + k) * d + j])
        axis = add(axis, turn_of_arm(angle, axis))
        for k in range(d):
            axes[(i * d + k) * d + j] = item(axis, k)
    bodies.offset[i] = add(bodies.offset[i], turn_of_arm(angle, bodies.offset[i]))
    if bodies.shape[i] >= 0:
        write_rotated(state, bodies.shape[i], i, state.rotated)
