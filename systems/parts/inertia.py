"""The inertia of a body of several parts: the parallel axis theorem."""

from __future__ import annotations

from ...components.spin import UNKNOWN, inertia_about
from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ..shapes.dispatch import second_moments
from ..shapes.quaternions import turned_tensor

OF_PART = "its PartOf has a mass, and it has no collider that tells its inertia: give it one, or PartOf.mass = 0"


@part
def has_own_inertia(state, i):
    """Whether row i has a shape with second moments."""
    shape = state.bodies.own_levels[state.level_count - 1, i]
    return shape >= 0 and state.shapes.moments[shape] != 0


@part
def inertia_of_row(state, i, mass):
    """(xx, yy, zz, xy, xz, yz) of a shape of that mass about the body's position, along the axes of its own row."""
    if not has_own_inertia(state, i):
        state.blamed = i + 1
        raise ValueError(UNKNOWN)
    shape = state.bodies.own_levels[state.level_count - 1, i]
    return inertia_about(second_moments(state, shape, i), state.colliders.offset[state.shapes.slots[shape], i], mass)


@part
def inertia_with_parts(state, i, gyration):
    """The same of a body and all its parts, along its own axes. What of its mass is not that of parts is spread over
    its own collider; without one it has that inertia per mass. If parts have more than the whole, they count for
    less."""
    bodies, parts, plane = state.bodies, state.parts, len(zero_of(state)) == 2
    of_parts, k = 0.0, bodies.next_part[i]
    while k >= 0:
        of_parts += parts.mass[bodies.part[k]]
        k = bodies.next_part[k]
    own, share = bodies.mass[i] - of_parts, 1.0
    if own < 0.0:
        own, share = 0.0, bodies.mass[i] / of_parts
    xx, yy, zz, xy, xz, yz = gyration
    xx, yy, zz, xy, xz, yz = own * xx, own * yy, own * zz, own * xy, own * xz, own * yz
    if own > 0.0 and bodies.own_levels[state.level_count - 1, i] >= 0:
        xx, yy, zz, xy, xz, yz = inertia_of_row(state, i, own)
    k = bodies.next_part[i]
    while k >= 0:
        p = bodies.part[k]
        if parts.mass[p] > 0.0:
            m, kept = share * parts.mass[p], parts.kept
            lost = not bodies.own_levels[state.level_count - 1, k] >= 0
            lost &= kept[p, 2] == kept[p, 2]
            if lost:  # its collider, for a moment: as it was
                tensor = m * kept[p, 0], m * kept[p, 1], m * kept[p, 2], m * kept[p, 3], m * kept[p, 4], m * kept[p, 5]
            elif has_own_inertia(state, k):
                tensor = inertia_of_row(state, k, m)
            else:
                state.blamed = k + 1
                raise ValueError(OF_PART)
            if not plane:
                turn = parts.turn[p, 0], parts.turn[p, 1], parts.turn[p, 2], parts.turn[p, 3]
                tensor = turned_tensor(turn, tensor)
            xx, yy, zz = xx + tensor[0], yy + tensor[1], zz + tensor[2]
            xy, xz, yz = xy + tensor[3], xz + tensor[4], yz + tensor[5]
        k = bodies.next_part[k]
    return xx, yy, zz, xy, xz, yz
