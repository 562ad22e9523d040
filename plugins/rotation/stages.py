"""The stages of a step in which bodies turn.

In a plane the angle is one more coordinate, and is advanced as positions are. In space a body turns under no torque as
Euler's equations say (see free_rotation), between two halves of what torques and damping do: of order 1, 2 or 4, as the
integrator of the positions is.
"""

from __future__ import annotations

import math

from ...components import SphereCollider
from ...components.spin import FASTEST_TURN, UNKNOWN, Spin, inertia_about
from ...framework import Plugin
from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import item, length, replace, scale
from ...systems.compounds.inertia import inertia_of_compound
from ...systems.compounds.rows import has_parts
from ...systems.forces.stages import is_zero
from ...systems.integration.stages import CUBIC, LINE, phi1, phi2
from ...systems.shapes.dispatch import second_moments
from ...systems.shapes.quaternions import (
    product,
    product_of,
    rotate,
    rotation_in_space,
    set_rotation,
    turned_tensor,
    write_axes,
)
from .free_rotation import diagonalised, turn_freely, turn_to_energy

TRIPLE = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))  # of the step: the outer two of Yoshida's three
PARALLEL = 1e-9  # square of the sine between spin and angular momentum: less is none
SLOW = 1e-4  # rad in a step: what turns slower may fall asleep, if it is dynamic
TOO_FAST = f"a torque is so large for the inertia that Spin.angular_velocity exceeds {FASTEST_TURN:g} rad/s"
NOT_POSITIVE = "Spin.inertia must be positive and finite"

spinning = Plugin("stages of rotation")


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
    if has_parts(state, i):
        return inertia_of_compound(state, i)
    shape = bodies.levels[0, i] if state.collides else -1
    several = state.collides and state.several_levels and bodies.levels[state.level_count - 1, i] != shape
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


@part
def torque_on(spin, i, k):
    """Along one axis."""
    return spin.constant_torque[i, k] + spin.applied_torque[i, k] + spin.step_torque[i, k]


@part
def turn_in_plane(state, spin, i, h):
    """The angle and the angular velocity of a dynamic body after a step."""
    moment, damping, w = inertia_of(state, spin, i)[2], spin.angular_damping[i], spin.angular_velocity[i, 0]
    acceleration = torque_on(spin, i, 0) / moment if moment > 0.0 else 0.0
    w, z, most = limited((w, 0.0, 0.0), spin.max_angular_speed[i])[0], -damping * h, spin.max_angular_speed[i]
    new = w * math.exp(z) + acceleration * h * phi1(z)
    turn = h * new
    if state.usual_path_degree > LINE:
        turn = h * (w * phi1(z) + acceleration * h * phi2(z))
    elif state.moves_with_old_velocity:
        turn = h * w
    new = limited((new, 0.0, 0.0), most)[0]
    if abs(turn) > most * h:
        turn = math.copysign(most * h, turn)
    spin.angular_velocity[i, 0] = new
    state.bodies.rotation[i] += turn


@part
def pushed(q, m, inverse, act, h):
    """The angular momentum along the principal axes after h seconds of torque and damping. act: (torque along the axes
    of the world, damping)."""
    along, decay, gain = rotate(q, act[0], True), math.exp(-act[1] * h), h * phi1(-act[1] * h)
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
def turn_in_space(state, spin, i, h):
    """The rotation and the angular velocity of a dynamic body after a step."""
    principal, inverse, own = principal_moments(state, spin, i)
    w, speed = (
        (spin.angular_velocity[i, 0], spin.angular_velocity[i, 1], spin.angular_velocity[i, 2]),
        spin.angular_velocity,
    )
    torque, most = (torque_on(spin, i, 0), torque_on(spin, i, 1), torque_on(spin, i, 2)), spin.max_angular_speed[i]
    act, q = (torque, spin.angular_damping[i]), product(rotation_in_space(state, i), own)
    along = rotate(q, limited(w, most), True)
    m, gained = (along[0] * principal[0], along[1] * principal[1], along[2] * principal[2]), 0.0
    if state.usual_path_degree == CUBIC:
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
def turn_about(state, i, angle):
    """A body turns by an angle; in space by a vector, about its direction."""
    if len(angle) == 2:
        state.bodies.rotation[i] += item(angle, 0)
        return
    size = length(angle)
    if size > 0.0:
        s = math.sin(0.5 * size) / size
        turn = math.cos(0.5 * size), s * item(angle, 0), s * item(angle, 1), s * item(angle, 2)
        set_rotation(state, i, product(turn, rotation_in_space(state, i)))


@part
def spin_of(state, spin, i):
    """The angular velocity of a body; in a plane the first component."""
    w = zero_of(state)
    for k in range(1 if len(w) == 2 else 3):
        w = replace(w, k, spin.angular_velocity[i, k])
    return w


@spinning.stage(
    after="check_flight", records=(Spin,),
    reads=(
        "mass", "quarantined", "still", "levels", "shapes", "spin.inertia", "spin.angular_damping",
        "spin.max_angular_speed", "spin.constant_torque", "spin.applied_torque",
    ),
    writes=("rotation", "axes", "spin.angular_velocity", "spin.step_torque"),
)  # fmt: skip
def turn_bodies(state, dt, spin):
    """bodies turn"""
    bodies, parts = state.bodies, 1 if len(zero_of(state)) == 2 else 3
    for i in range(state.first, state.moving):
        if not spin.present[i] or bodies.still[i] > 0 or bodies.quarantined[i]:
            continue
        if i >= state.dynamic:
            turn_about(state, i, scale(spin_of(state, spin, i), dt))
        elif parts == 1:
            turn_in_plane(state, spin, i, dt)
        else:
            turn_in_space(state, spin, i, dt)
        if not length(spin_of(state, spin, i)) <= FASTEST_TURN:
            state.blamed = i + 1
            raise ValueError(TOO_FAST)
        write_axes(state, i)
        for k in range(parts):
            spin.step_torque[i, k] = 0.0


@part
def inverted(xx, yy, zz, xy, xz, yz):
    """The inverse of a symmetric matrix; about axes of the body without inertia it does not turn."""
    if xy == 0.0 and xz == 0.0 and yz == 0.0:
        inverse = 1.0 / xx if xx > 0.0 else 0.0, 1.0 / yy if yy > 0.0 else 0.0, 1.0 / zz if zz > 0.0 else 0.0
        return inverse[0], inverse[1], inverse[2], 0.0, 0.0, 0.0
    a, b, c = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    d, e, f = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
    size = xx * a + xy * d + xz * e
    if not size > 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return a / size, b / size, c / size, d / size, e / size, f / size


@part
def write_inverse_inertia(state, spin, i):
    """How impulses of contacts turn a body, along the axes of the world."""
    bodies, nothing = state.bodies, zero_of(state)
    xx, yy, zz, xy, xz, yz = inertia_of(state, spin, i)
    if len(nothing) == 2:
        bodies.inverse_inertia[i] = replace(nothing, 0, 1.0 / zz if zz > 0.0 else 0.0)
        return
    xx, yy, zz, xy, xz, yz = inverted(xx, yy, zz, xy, xz, yz)
    if xx == yy == zz and xy == xz == yz == 0.0:  # round, to the bit
        bodies.inverse_inertia[i] = replace(replace(replace(nothing, 0, xx), 1, xx), len(nothing) - 1, xx)
        return
    xx, yy, zz, xy, xz, yz = turned_tensor(rotation_in_space(state, i), (xx, yy, zz, xy, xz, yz))
    bodies.inverse_inertia[i] = replace(replace(replace(nothing, 0, xx), 1, yy), len(nothing) - 1, zz)
    bodies.inverse_products[i] = replace(replace(replace(nothing, 0, xy), 1, xz), len(nothing) - 1, yz)


@spinning.stage(
    after="check_flight", records=(Spin,),
    reads=(
        "mass", "quarantined", "shapes", "levels", "offset", "rotation", "spin.inertia", "spin.angular_velocity",
        "spin.rolling_friction",
    ),
    writes=("spin", "inverse_inertia", "inverse_products", "rolling_radius", "rolling_friction", "turn", "reach"),
    needed="colliders or joints",
)  # fmt: skip
def share_spins(state, dt, spin):
    """how fast bodies spin, and how contacts turn them"""
    bodies, zero = state.bodies, zero_of(state)
    state.spinning = True
    for i in range(state.count):
        w, moves = zero, state.first <= i < state.moving and spin.present[i] and not bodies.quarantined[i]
        if moves:
            w = spin_of(state, spin, i)
        bodies.spin[i], bodies.turn[i] = w, scale(w, dt)
        bodies.inverse_inertia[i], bodies.inverse_products[i], bodies.rolling_radius[i] = zero, zero, 0.0
        bodies.rolling_friction[i] = spin.rolling_friction[i] if spin.present[i] else 0.0
        if moves and i < state.dynamic:
            write_inverse_inertia(state, spin, i)


@spinning.stage(
    after="check_flight", records=(Spin, SphereCollider),
    reads=("quarantined", "shapes", "levels", "offset", "inverse_inertia", "sphere_collider.radius"),
    writes=("rolling_radius",), needed="colliders",
)  # fmt: skip
def find_round(state, dt, spin, sphere):
    """which bodies roll: contacts push on their centre, and turn them by friction alone"""
    bodies, d = state.bodies, len(zero_of(state))
    for i in range(state.first, state.moving):
        if bodies.quarantined[i] or not (spin.present[i] and sphere.present[i]):  # of the first there is no shape
            continue
        shape, inverse, others = bodies.levels[0, i], bodies.inverse_inertia[i], bodies.inverse_products[i]
        several = state.several_levels and bodies.levels[state.level_count - 1, i] != shape  # another one decides
        if several or not is_zero(state.colliders.offset[state.shapes.slots[shape], i]):
            continue
        alike = is_zero(others) and item(inverse, 0) == item(inverse, 1) == item(inverse, d - 1)
        if d == 2 or i >= state.dynamic or alike:
            bodies.rolling_radius[i] = sphere.radius[i]


@part
def turn_on_in_space(state, spin, i, angle, dt):
    """Impacts have changed the spin of a body, which is to turn by ``angle`` beyond where the step has turned it: as
    near to that as turning freely and about the angular momentum lead, which keep energy and momentum."""
    principal, inverse, own = principal_moments(state, spin, i)
    w = spin.angular_velocity[i, 0], spin.angular_velocity[i, 1], spin.angular_velocity[i, 2]
    d, square = (item(angle, 0), item(angle, 1), item(angle, len(angle) - 1)), product_of(w, w)
    if square == 0.0 or principal[0] == principal[1] == principal[2]:
        turn_about(state, i, angle)
        return
    q = product(rotation_in_space(state, i), own)
    along = rotate(q, w, True)
    m = along[0] * principal[0], along[1] * principal[1], along[2] * principal[2]
    momentum = rotate(q, m, False)
    both, size = product_of(w, momentum), product_of(momentum, momentum)
    free, apart = product_of(d, w) / square, square * size - both * both
    if apart > PARALLEL * square * size:
        free = (product_of(d, w) * size - product_of(d, momentum) * both) / apart
    free = min(max(free, -dt), dt)
    about = (product_of(d, momentum) - free * both) / size  # what is left
    q, m, gained = turn_freely(q, m, inverse, free)
    q, m = turn_to_energy(q, m, inverse, gained)
    set_rotation(state, i, product(q, (own[0], -own[1], -own[2], -own[3])))
    axis = replace(replace(replace(angle, 0, momentum[0]), 1, momentum[1]), len(angle) - 1, momentum[2])
    turn_about(state, i, scale(axis, about))
    q = product(rotation_in_space(state, i), own)
    w = rotate(q, (m[0] * inverse[0], m[1] * inverse[1], m[2] * inverse[2]), False)
    spin.angular_velocity[i, 0], spin.angular_velocity[i, 1], spin.angular_velocity[i, 2] = w[0], w[1], w[2]


@spinning.stage(
    after="resolve_static_penetration",
    records=(Spin,),
    reads=("spin", "turn", "quarantined", "spin.max_angular_speed"),
    writes=("spin.angular_velocity", "rotation", "axes"),
    needed="colliders or joints",
)
def take_spins(state, dt, spin):
    """what contacts have made of the spins; the step has turned the bodies with these"""
    bodies, parts = state.bodies, 1 if len(zero_of(state)) == 2 else 3
    for i in range(state.first, state.dynamic):
        if not spin.present[i] or bodies.quarantined[i]:
            continue
        changed, further = False, bodies.turn[i]
        for k in range(parts):
            old, new = spin.angular_velocity[i, k], item(bodies.spin[i], k)
            changed |= new != old or item(bodies.turn[i], k) != old * dt
            further = replace(further, k, item(bodies.turn[i], k) - old * dt)
            spin.angular_velocity[i, k] = new
        if not changed:
            continue
        if parts == 1 or (state.solver.contacts + state.solver.joints.active > 0 and bodies.held[i]):
            turn_about(state, i, further)
        else:
            turn_on_in_space(state, spin, i, further, dt)
        write_axes(state, i)
        size, most = length(spin_of(state, spin, i)), spin.max_angular_speed[i]
        for k in range(parts if size > most else 0):
            spin.angular_velocity[i, k] *= most / size


@spinning.stage(
    before="update_sleep", records=(Spin,),
    reads=("spin.angular_velocity", "spin.constant_torque", "spin.applied_torque", "spin.step_torque"),
    writes=("rest_steps",), needed="sleeping",
)  # fmt: skip
def keep_spinning_awake(state, dt, spin):
    """what turns, or is to, does not fall asleep"""
    for i in range(state.first, state.moving):
        if spin.present[i]:
            pushed = False
            for k in range(1 if len(zero_of(state)) == 2 else 3):
                pushed |= torque_on(spin, i, k) != 0.0
            if pushed or length(spin_of(state, spin, i)) * dt > (SLOW if i < state.dynamic else 0.0):
                state.bodies.rest_steps[i] = 0


@spinning.stage(
    after="update_sleep", records=(Spin,), reads=("still",), writes=("spin.angular_velocity",), needed="sleeping",
)  # fmt: skip
def stop_sleepers(state, dt, spin):
    """what falls asleep turns no more"""
    for i in range(state.first, state.dynamic):
        if spin.present[i] and state.bodies.still[i] > 0:
            for k in range(1 if len(zero_of(state)) == 2 else 3):
                spin.angular_velocity[i, k] = 0.0
