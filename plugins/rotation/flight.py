"""How bodies turn in a step.

In a plane the angle is one more coordinate, and is advanced as positions are. In space a body turns under no torque as
Euler's equations say (see free_rotation), between two halves of what torques and damping do: of order 1, 2 or 4, as the
integrator of the positions is.

Where force systems give torques these are evaluated at each stage of the integrator, and bodies turn within the step.
In space Verlet steps, and what composes them, push by the torques of both ends and turn freely in between; RK4 turns by
a vector from the rotation at the start (Munthe-Kaas 1998), and its other state is the angular momentum.
"""

from __future__ import annotations

import math

from ...components.spin import UNKNOWN, inertia_about
from ...framework.compilation import inlined, part
from ...framework.elementary import exp
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add_scaled, cross, length, scale
from ...systems.integration.stages import CUBE_ROOT_OF_2, CUBIC, LINE, kick_gain, phi1, phi2, runge_kutta_weights
from ...systems.integration.turning import quaternion_of
from ...systems.parts.inertia import inertia_with_parts
from ...systems.parts.rows import has_parts
from ...systems.shapes.dispatch import second_moments
from ...systems.shapes.free_rotation import diagonalised, turn_freely, turn_to_energy
from ...systems.shapes.quaternions import product, rotate, rotation_in_space, set_rotation

TRIPLE = 1.0 / (2.0 - CUBE_ROOT_OF_2)  # of the step: the outer two of Yoshida's three
HEAVY = 5.0  # damping times the step: above it the middle one, which goes back in time, enlarges rounding too much
NOT_POSITIVE = "Spin.inertia must be positive and finite"
FAST_TURN = 0.5  # rad in a step: what turns faster in space RK4 changes the energy of more than Verlet steps do
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
    size = length(w)
    return scale(w, most / size if size > most else 1.0)


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
def by_axis(v, factors):
    """Three numbers, each times its own factor."""
    return v[0] * factors[0], v[1] * factors[1], v[2] * factors[2]


@part
def spin_now(state, spin, i):
    """Three numbers; in a plane the first."""
    w = spin.angular_velocity
    if is_plane(state):
        return w[i, 0], 0.0, 0.0
    return w[i, 0], w[i, 1], w[i, 2]


@part
def put_spin(state, spin, i, w):
    spin.angular_velocity[i, 0] = w[0]
    if not is_plane(state):
        spin.angular_velocity[i, 1], spin.angular_velocity[i, 2] = w[1], w[2]


@part
def frame_of(state, i, own):
    """The unit quaternion of the principal axes of body i, which ``own`` turns to the body's."""
    return product(rotation_in_space(state, i), own)


@part
def motion_of_spin(state, spin, i, w):
    """(quaternion of the principal axes, angular momentum along them of a body with that spin, its moments)."""
    moments = principal_moments(state, spin, i)
    q = frame_of(state, i, moments[2])
    return q, by_axis(rotate(q, w, True), moments[0]), moments


@part
def put_motion(state, spin, i, q, m, moments):
    """Body i is turned so that its principal axes are those of q, and has the angular momentum m along them."""
    _, inverse, own = moments
    put_spin(state, spin, i, rotate(q, by_axis(m, inverse), False))
    set_rotation(state, i, product(q, (own[0], -own[1], -own[2], -own[3])))


@part
def turn_in_space(state, spin, turns, i, h):
    """The rotation and the angular velocity of a dynamic body after a step."""
    most, act, gained = spin.max_angular_speed[i], (torques_on(state, spin, turns, i), spin.angular_damping[i]), 0.0
    q, m, moments = motion_of_spin(state, spin, i, limited(spin_now(state, spin, i), most))
    inverse = moments[1]
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
    put_motion(state, spin, i, q, m, moments)
    put_spin(state, spin, i, limited(spin_now(state, spin, i), most))


@part
def turn_alone(state, spin, turns, i, h):
    """A step of a dynamic body under the torques of this moment."""
    if is_plane(state):
        turn_in_plane(state, spin, turns, i, h)
    else:
        turn_in_space(state, spin, turns, i, h)


# -- where torques change within the step ------------------------------------------------------------------------------


@part
def triple(column, i):
    return column[i, 0], column[i, 1], column[i, 2]


@part
def put(column, i, v):
    column[i, 0], column[i, 1], column[i, 2] = v


@part
def momentum_of(state, spin, i, w):
    """Of a body that turns so fast, along the axes of the world."""
    if is_plane(state):
        return inertia_of(state, spin, i)[2] * w[0], 0.0, 0.0
    q, m, _ = motion_of_spin(state, spin, i, w)
    return rotate(q, m, False)


@part
def spin_by(state, spin, i, momentum):
    """How fast a body turns that has such an angular momentum, as it is turned now."""
    if is_plane(state):
        moment = inertia_of(state, spin, i)[2]
        return momentum[0] / moment if moment > 0.0 else 0.0, 0.0, 0.0
    _, inverse, own = principal_moments(state, spin, i)
    q = frame_of(state, i, own)
    return rotate(q, by_axis(rotate(q, momentum, True), inverse), False)


@part
def begin_turn(state, spin, turns, i):
    """What the step began with."""
    rotation, width = state.bodies.rotation, 1 if is_plane(state) else 4
    for k in range(width):
        turns.start_rotation[i, k] = rotation[width * i + k]
    put(turns.start_spin, i, spin_now(state, spin, i))
    turns.gained[i], turns.changed[i] = 0.0, False


@part
def put_start_back(state, spin, turns, i):
    """Of a body that the flight has taken out."""
    rotation, width = state.bodies.rotation, 1 if is_plane(state) else 4
    for k in range(width):
        rotation[width * i + k] = turns.start_rotation[i, k]
    put_spin(state, spin, i, triple(turns.start_spin, i))


@part
def drift_of_turn(state, spin, turns, i, h):
    """A Verlet step of a turn with the torques at its start."""
    w, torque, c = spin_now(state, spin, i), torques_on(state, spin, turns, i), spin.angular_damping[i]
    put(turns.pushed, i, torque)
    if is_plane(state):
        z, a = -c * h, spin_by(state, spin, i, torque)[0]
        state.bodies.rotation[i] += h * (w[0] * phi1(z) + a * h * phi2(z))
        put_spin(state, spin, i, (w[0] * exp(z) + a * h * phi1(z), 0.0, 0.0))
        return
    q, m, moments = motion_of_spin(state, spin, i, w)
    q, m, gained = turn_between_pushes(q, m, moments[1], (torque, c), h)
    turns.gained[i] += gained
    put_motion(state, spin, i, q, m, moments)


@part
def kick_of_turn(state, spin, turns, i, h):
    """Its second half: the torques at its end in place of those at its start."""
    z = -spin.angular_damping[i] * h
    change = spin_by(state, spin, i, add_scaled(torques_on(state, spin, turns, i), triple(turns.pushed, i), -1.0))
    gain = kick_gain(z, h) if is_plane(state) else 0.5 * h * phi1(0.5 * z)
    put_spin(state, spin, i, add_scaled(spin_now(state, spin, i), change, gain))


@part
def turn_from_start(state, turns, i, turned):
    """A body is turned by a vector from where the step began."""
    put(turns.turned, i, turned)
    if is_plane(state):
        state.bodies.rotation[i] = turns.start_rotation[i, 0] + turned[0]
        return
    start = turns.start_rotation
    set_rotation(state, i, product(quaternion_of(turned), (start[i, 0], start[i, 1], start[i, 2], start[i, 3])))


@part
def runge_kutta_turn(state, spin, turns, i, h):
    """As ``runge_kutta_stage`` does with places: the vector that a body has turned by, and its angular momentum. Where
    the torque holds throughout the step there are better ways, which keep the energy of a free top; and what turns fast
    in space takes two Verlet steps of half the length, whose torques are those of the stages."""
    stage, torque, w = state.rk_stage, torques_on(state, spin, turns, i), spin_now(state, spin, i)
    f1, f2, f3, decay, half_decay, half_gain = runge_kutta_weights(-spin.angular_damping[i] * h)
    half = 0.5 * h * half_gain
    if stage == 0:
        put(turns.pushed, i, torque)
        turned = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
        turns.fast[i] = not is_plane(state) and turned * h * h > FAST_TURN * FAST_TURN
    turns.changed[i] |= torque != triple(turns.pushed, i)
    if stage == 3 and not turns.changed[i]:
        turns.gained[i] = 0.0
        put_start_back(state, spin, turns, i)
        turn_alone(state, spin, turns, i, h)
        return
    if turns.fast[i]:
        if stage == 0 or stage == 2:
            drift_of_turn(state, spin, turns, i, 0.5 * h)
        else:
            kick_of_turn(state, spin, turns, i, 0.5 * h)
        return
    if stage == 0:
        start = momentum_of(state, spin, i, w)
        put(turns.momentum, i, start)
        put(turns.speeds, i, w)
        put(turns.kicks, i, scale(torque, f1))
        momentum = add_scaled(scale(start, half_decay), torque, half)
        put(turns.middle, i, momentum)
        turn_from_start(state, turns, i, scale(w, 0.5 * h))
    else:
        turned, start = triple(turns.turned, i), triple(turns.momentum, i)
        across = cross(turned, w)  # how fast the vector of the turn changes: the series of dexp^-1
        rate = add_scaled(add_scaled(w, across, -0.5), cross(turned, across), 1.0 / 12.0)
        if stage == 3:
            momentum = add_scaled(scale(start, decay), add_scaled(triple(turns.kicks, i), torque, f3), h)
            turn_from_start(state, turns, i, scale(add_scaled(triple(turns.speeds, i), rate, 1.0), h / 6.0))
        else:
            put(turns.speeds, i, add_scaled(triple(turns.speeds, i), rate, 2.0))
            put(turns.kicks, i, add_scaled(triple(turns.kicks, i), torque, 2.0 * f2))
            momentum = add_scaled(scale(start, half_decay), torque, half)
            if stage == 2:
                both = add_scaled(scale(torque, 2.0), triple(turns.pushed, i), -1.0)
                momentum = add_scaled(scale(triple(turns.middle, i), half_decay), both, half)
            turn_from_start(state, turns, i, scale(rate, h if stage == 2 else 0.5 * h))
    put_spin(state, spin, i, spin_by(state, spin, i, momentum))


@part
def end_turn(state, spin, turns, i, dt):
    """What splitting has gained of energy goes; limits of speed."""
    most = spin.max_angular_speed[i]
    if is_plane(state):
        start, rotation = turns.start_rotation[i, 0], state.bodies.rotation
        if abs(rotation[i] - start) > most * dt:
            rotation[i] = start + math.copysign(most * dt, rotation[i] - start)
    elif turns.gained[i] != 0.0:
        q, m, moments = motion_of_spin(state, spin, i, spin_now(state, spin, i))
        q, m = turn_to_energy(q, m, moments[1], turns.gained[i])
        put_motion(state, spin, i, q, m, moments)
    put_spin(state, spin, i, limited(spin_now(state, spin, i), most))
