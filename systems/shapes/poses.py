"""Shapes as they are turned: what reads the axes of a body sees these.

In space the axis about which a body turns moves with it, unless its moments are equal: its spin and its inertia are
those of the moment for which its shape stands.
"""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.elementary import atan2
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, components, item, length, replace, scale, triple
from ..integration.turning import turn_of_arm
from ..linking.parts import FREE_TURN, call_free_turn
from .dispatch import write_rotated
from .free_rotation import diagonalised, turn_freely, turn_to_energy
from .quaternions import product, rotate, turned_tensor

NO_INERTIA = 1e-14  # of the largest of the inverse moments: what is less is rounding of none, about a line of no width


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
        write_rotated(state, bodies.shape[i], i)


@part
def motion_of(state, i):
    """What :func:`advance_pose` changes of body i."""
    bodies = state.bodies
    return bodies.spin[i], bodies.inverse_inertia[i], bodies.inverse_products[i]


@part
def set_motion(state, i, motion):
    bodies = state.bodies
    bodies.spin[i], bodies.inverse_inertia[i], bodies.inverse_products[i] = motion


@part
def row_of_axes(state, i, k):
    """Row k of the rotation matrix of body i; of 0 if there is none."""
    axes, found, d = state.bodies.axes, zero_of(state), len(zero_of(state))
    for j in range(d if len(axes) > 0 else 0):
        found = replace(found, j, axes[(i * d + k) * d + j])
    return found


@part
def pose_of(state, i):
    """How body i spins, and how its shape is turned."""
    last = len(zero_of(state)) - 1
    rows = row_of_axes(state, i, 0), row_of_axes(state, i, 1), row_of_axes(state, i, last)
    return motion_of(state, i), state.bodies.offset[i], rows


@part
def has_unequal_moments(state, i):
    """Whether the axis about which body i turns by itself may move."""
    diagonal, products = state.bodies.inverse_inertia[i], state.bodies.inverse_products[i]
    if len(diagonal) == 2:
        return False
    x, y, z = components(diagonal)
    return not (x == y == z and length(products) == 0.0)


@part
def principal_axes(state, i):
    """(1 / principal moments; unit quaternion from the axes of the world to these) of body i."""
    v, u = state.bodies.inverse_inertia[i], state.bodies.inverse_products[i]
    last = len(v) - 1
    (x, y, z), q = diagonalised(item(v, 0), item(v, 1), item(v, last), item(u, 0), item(u, 1), item(u, last))
    least = NO_INERTIA * max(x, max(y, z))
    return (x if x > least else 0.0, y if y > least else 0.0, z if z > least else 0.0), q


@part
def momentum_along(q, inverse, spin):
    """The angular momentum along the principal axes, to which q turns; none about an axis without inertia."""
    along = rotate(q, components(spin), True)
    return (
        along[0] / inverse[0] if inverse[0] > 0.0 else 0.0,
        along[1] / inverse[1] if inverse[1] > 0.0 else 0.0,
        along[2] / inverse[2] if inverse[2] > 0.0 else 0.0,
    )


@part
def advance_pose(state, i, spin, h):
    """The vector by which body i turns freely in h seconds from that spin; its own spin and its inertia become those of
    that time, its shape stays."""
    if len(spin) == 2:  # a case of its own: what follows is not compiled then
        return scale(spin, h)
    if h == 0.0 or length(state.bodies.spin[i]) + length(spin) == 0.0 or not has_unequal_moments(state, i):
        return scale(spin, h)
    return call_free_turn(state.links[FREE_TURN], state, i, spin, h)


def turn_with_unequal_moments(state, i, spin, h):
    """The same in space, where the axis about which body i turns moves."""
    bodies, own = state.bodies, state.bodies.spin[i]
    inverse, q = principal_axes(state, i)
    m, mine = momentum_along(q, inverse, spin), momentum_along(q, inverse, own)
    to, m, gained = turn_freely(q, m, inverse, h)
    to, m = turn_to_energy(to, m, inverse, gained)
    mine = rotate(to, rotate(q, mine, False), True)  # stays what it is in space
    xx, yy, zz, xy, xz, yz = turned_tensor(to, (inverse[0], inverse[1], inverse[2], 0.0, 0.0, 0.0))
    bodies.inverse_inertia[i] = triple(spin, (xx, yy, zz))
    bodies.inverse_products[i] = triple(spin, (xy, xz, yz))
    bodies.spin[i] = triple(spin, rotate(to, (mine[0] * inverse[0], mine[1] * inverse[1], mine[2] * inverse[2]), False))
    by = product(to, (q[0], -q[1], -q[2], -q[3]))
    sine = math.sqrt(by[1] * by[1] + by[2] * by[2] + by[3] * by[3])
    size = 2.0 * atan2(sine, by[0]) / sine if sine > 0.0 else 0.0
    return triple(spin, (size * by[1], size * by[2], size * by[3]))


@part
def rotate_pose(state, i, spin, h):
    """The same, and its shape turns by that."""
    turn_shape(state, i, advance_pose(state, i, spin, h))


@part
def turn_to(state, i, end, spin, until, t):
    """Body i is turned, and spins, as it does at time t, from its pose ``end`` at another: so there is one way on which
    it turns, at whatever times it is seen, and to the bit its pose then."""
    motion, offset, rows = end
    bodies, axes, d = state.bodies, state.bodies.axes, len(spin)
    if len(axes) == 0 or length(motion[0]) + length(spin) == 0.0:
        return
    for k in range(d):
        for j in range(d):
            axes[(i * d + k) * d + j] = item(rows[k], j)
    bodies.offset[i] = offset
    set_motion(state, i, motion)
    if t != until:
        rotate_pose(state, i, spin, t - until)
    elif bodies.shape[i] >= 0:
        write_rotated(state, bodies.shape[i], i)
