"""How bodies turn in a step whose torques hold throughout it.

In a plane the angle is one more coordinate, and is advanced as positions are. In space a body turns under no torque as
Euler's equations say (see free_rotation), between two halves of what torques and damping do: of order 1, 2 or 4, as the
integrator of the positions is.
"""

from __future__ import annotations

import math

from ...components.spin import UNKNOWN, inertia_about
from ...framework.compilation import inlined, part
from ...framework.elementary import exp
from ...framework.jit.records.record_type import zero_of
from ...systems.integration.stages import CUBE_ROOT_OF_2, CUBIC, LINE, phi1, phi2
from ...systems.parts.inertia import inertia_with_parts
from ...systems.parts.rows import has_parts
from ...systems.shapes.dispatch import second_moments
from ...systems.shapes.free_rotation import diagonalised, turn_freely, turn_to_energy
from ...systems.shapes.quaternions import product, rotate, rotation_in_space, set_rotation

TRIPLE = 1.0 / (2.0 - CUBE_ROOT_OF_2)  # of the step: the outer two of Yoshida's three
HEAVY = 5.0  # damping times the step: above it the middle one, which goes back in time, enlarges rounding too much
NOT_POSITIVE = "Spin.inertia must be positive and finite"
NO_EXTENT = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@part
def gyration_of(state, spin, i):
    """Inertia per mass of the collider that a body has had last."""
    own, products = spin.gyration, spin.gyration_products
    if len(zero_of(state)) == 2:
        return 0.0, 0.0, own[i, 0], 0.0, 0.0, 0.0
    return own[i, 0], own[i, 1], own[i, 2], products[i, 0], products[i, 1], products[i, 2]


@part
def inertia_of(state, spin, i):
    """(xx, yy, zz, xy, xz, yz) of the inertia of body i about its position, along its own axes; in a plane zz alone."""
    d, bodies = len(zero_of(state)), state.bodies
    if spin.inertia[i, 0] == spin.inertia[i, 0]:
        for k in range(1 if d == 2 else 3):
            if not 0.0 < spin.inertia[i, k] < math.inf:
                state.blamed = i + 1
                raise ValueError(NOT_POSITIVE)
        if d == 2:
            return 0.0, 0.0, spin.inertia[i, 0], 0.0, 0.0, 0.0
        return spin.inertia[i, 0], spin.inertia[i, 1], spin.inertia[i, 2], 0.0, 0.0, 0.0
    shape = bodies.own_levels[0, i]
    lost = shape < 0 and spin.gyration[i, 0] == spin.gyration[i, 0]
    if has_parts(state, i):
        return inertia_with_parts(state, i, gyration_of(state, spin, i) if lost else NO_EXTENT)
    if lost:
        xx, yy, zz, xy, xz, yz = gyration_of(state, spin, i)
        m = bodies.mass[i]
        return m * xx, m * yy, m * zz, m * xy, m * xz, m * yz
    several = state.several_levels and bodies.own_levels[state.level_count - 1, i] != shape
    if shape < 0 or several or state.shapes.moments[shape] == 0:
        state.blamed = i + 1
        raise ValueError(UNKNOWN)
    found, offset = second_moments(state, shape, i), state.colliders.offset[state.shapes.slots[shape], i]
    return inertia_about(found, offset, bodies.mass[i])


@part
def limited(w, most):
    """An angular velocity, shortened if it exceeds the limit; nan: none."""
    size = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    by = most / size if size > most else 1.0
    return w[0] * by, w[1] * by, w[2] * by


@inlined
def at_most(w, most):
    """A number, no larger than the limit; nan: none."""
    return math.copysign(most, w) if abs(w) > most else w


@part
def torque_on(state, spin, turns, i, k):
    """Along one axis."""
    torque, given = spin.constant_torque[i, k] + spin.applied_torque[i, k] + spin.step_torque[i, k], turns.torque
    if len(turns.lifting) > 0:
        torque += turns.lifting[i, k]
    if len(given) == 0:
        return torque
    return torque + given[i if is_plane(state) else 3 * i + k]


@part
def is_plane(state):
    return len(zero_of(state)) == 2


@part
def torques_on(state, spin, turns, i):
    """Three numbers; in a plane the first."""
    x = torque_on(state, spin, turns, i, 0)
    if is_plane(state):
        return x, 0.0, 0.0
    return x, torque_on(state, spin, turns, i, 1), torque_on(state, spin, turns, i, 2)


@part
def turn_in_plane(state, spin, turns, i, h):
    """The angle and the angular velocity of a dynamic body after a step."""
    moment, z, most = inertia_of(state, spin, i)[2], -spin.angular_damping[i] * h, spin.max_angular_speed[i]
    acceleration = torque_on(state, spin, turns, i, 0) / moment if moment > 0.0 else 0.0
    w = at_most(spin.angular_velocity[i, 0], most)
    new = w + acceleration * h
    if z != 0.0:
        new = w * exp(z) + acceleration * h * phi1(z)
    turn = h * new
    if state.usual_path_degree > LINE:
        turn = h * (w * phi1(z) + acceleration * h * phi2(z))
    elif state.moves_with_old_velocity:
        turn = h * w
    spin.angular_velocity[i, 0] = at_most(new, most)
    turn = at_most(turn, most * h)
    state.bodies.rotation[i] += turn


@part
def pushed(q, m, inverse, act, h):
    """The angular momentum along the principal axes after h seconds of torque and damping. act: (torque along the axes
    of the world, damping)."""
    along, decay, gain = rotate(q, act[0], True), exp(-act[1] * h), h * phi1(-act[1] * h)
    return (
        m[0] * decay + along[0] * gain if inverse[0] > 0.0 else 0.0,
        m[1] * decay + along[1] * gain if inverse[1] > 0.0 else 0.0,
        m[2] * decay + along[2] * gain if inverse[2] > 0.0 else 0.0,
    )


@part
def turn_between_pushes(q, m, inverse, act, h):
    """(q, m, energy gained by splitting) after half of what pushes, the free turn, and the other half: of order 2."""
    m = pushed(q, m, inverse, act, 0.5 * h)
    q, m, gained = turn_freely(q, m, inverse, h)
    return q, pushed(q, m, inverse, act, 0.5 * h), gained


@part
def principal_moments(state, spin, i):
    """(principal moments of inertia, 1 / these, unit quaternion from these axes to the body's own)."""
    xx, yy, zz, xy, xz, yz = inertia_of(state, spin, i)
    principal, own = (xx, yy, zz), (1.0, 0.0, 0.0, 0.0)
    if xy != 0.0 or xz != 0.0 or yz != 0.0:
        principal, own = diagonalised(xx, yy, zz, xy, xz, yz)
    inverse = (
        1.0 / principal[0] if principal[0] > 0.0 else 0.0,
        1.0 / principal[1] if principal[1] > 0.0 else 0.0,
        1.0 / principal[2] if principal[2] > 0.0 else 0.0,
    )
    return principal, inverse, own


@part
def turn_in_space(state, spin, turns, i, h):
    """The rotation and the angular velocity of a dynamic body after a step."""
    principal, inverse, own = principal_moments(state, spin, i)
    w, speed = (
        (spin.angular_velocity[i, 0], spin.angular_velocity[i, 1], spin.angular_velocity[i, 2]),
        spin.angular_velocity,
    )
    torque, most = torques_on(state, spin, turns, i), spin.max_angular_speed[i]
    act, q = (torque, spin.angular_damping[i]), product(rotation_in_space(state, i), own)
    along = rotate(q, limited(w, most), True)
    m, gained = (along[0] * principal[0], along[1] * principal[1], along[2] * principal[2]), 0.0
    if state.usual_path_degree == CUBIC and act[1] * h <= HEAVY:
        for place in range(3):
            q, m, more = turn_between_pushes(q, m, inverse, act, h * (TRIPLE if place != 1 else 1.0 - 2.0 * TRIPLE))
            gained += more
    elif state.usual_path_degree > LINE:
        q, m, gained = turn_between_pushes(q, m, inverse, act, h)
    elif state.moves_with_old_velocity:
        q, m, gained = turn_freely(q, m, inverse, h)
        m = pushed(q, m, inverse, act, h)
    else:
        m = pushed(q, m, inverse, act, h)
        q, m, gained = turn_freely(q, m, inverse, h)
    q, m = turn_to_energy(q, m, inverse, gained)
    w = limited(rotate(q, (m[0] * inverse[0], m[1] * inverse[1], m[2] * inverse[2]), False), most)
    speed[i, 0], speed[i, 1], speed[i, 2] = w[0], w[1], w[2]
    set_rotation(state, i, product(q, (own[0], -own[1], -own[2], -own[3])))


@part
def turn_alone(state, spin, turns, i, h):
    """A step of a dynamic body under the torques of this moment."""
    if is_plane(state):
        turn_in_plane(state, spin, turns, i, h)
    else:
        turn_in_space(state, spin, turns, i, h)
