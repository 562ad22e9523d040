"""Bodies turn within the step, where force systems give torques: these are evaluated at each stage of the integrator.

In a plane the angle is one more coordinate of the integrator. In space Verlet steps, and what composes them, push by
the torques of both ends and turn freely in between; RK4 turns by a vector from the rotation at the start (Munthe-Kaas
1998), and its other state is the angular momentum.
"""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.elementary import cos, exp, sin
from ...framework.vectors import add_scaled, cross, scale
from ...systems.integration.stages import kick_gain, phi1, phi2, runge_kutta_weights
from ...systems.shapes.free_rotation import turn_to_energy
from ...systems.shapes.quaternions import product, rotate, rotation_in_space, set_rotation
from .flight import inertia_of, is_plane, limited, principal_moments, torques_on, turn_alone, turn_between_pushes

FAST_TURN = 0.5  # rad in a step: what turns faster in space RK4 changes the energy of more than Verlet steps do


@part
def triple(column, i):
    return column[i, 0], column[i, 1], column[i, 2]


@part
def put(column, i, v):
    column[i, 0], column[i, 1], column[i, 2] = v


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
def scaled_along(q, v, by):
    """A vector whose components along the axes that q turns to are so many times as large."""
    along = rotate(q, v, True)
    return rotate(q, (along[0] * by[0], along[1] * by[1], along[2] * by[2]), False)


@part
def momentum_of(state, spin, i, w):
    """Of a body that turns so fast, along the axes of the world."""
    if is_plane(state):
        return inertia_of(state, spin, i)[2] * w[0], 0.0, 0.0
    principal, _, own = principal_moments(state, spin, i)
    return scaled_along(product(rotation_in_space(state, i), own), w, principal)


@part
def spin_by(state, spin, i, momentum):
    """How fast a body turns that has such an angular momentum, as it is turned now."""
    if is_plane(state):
        moment = inertia_of(state, spin, i)[2]
        return momentum[0] / moment if moment > 0.0 else 0.0, 0.0, 0.0
    _, inverse, own = principal_moments(state, spin, i)
    return scaled_along(product(rotation_in_space(state, i), own), momentum, inverse)


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
    principal, inverse, own = principal_moments(state, spin, i)
    q = product(rotation_in_space(state, i), own)
    m = rotate(q, w, True)
    m = m[0] * principal[0], m[1] * principal[1], m[2] * principal[2]
    q, m, gained = turn_between_pushes(q, m, inverse, (torque, c), h)
    turns.gained[i] += gained
    put_spin(state, spin, i, rotate(q, (m[0] * inverse[0], m[1] * inverse[1], m[2] * inverse[2]), False))
    set_rotation(state, i, product(q, (own[0], -own[1], -own[2], -own[3])))


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
    size = math.sqrt(turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2])
    s = sin(0.5 * size) / size if size > 0.0 else 0.5
    turn = cos(0.5 * size), s * turned[0], s * turned[1], s * turned[2]
    set_rotation(state, i, product(turn, (start[i, 0], start[i, 1], start[i, 2], start[i, 3])))


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
        principal, inverse, own = principal_moments(state, spin, i)
        q = product(rotation_in_space(state, i), own)
        m = rotate(q, spin_now(state, spin, i), True)
        m = m[0] * principal[0], m[1] * principal[1], m[2] * principal[2]
        q, m = turn_to_energy(q, m, inverse, turns.gained[i])
        put_spin(state, spin, i, rotate(q, (m[0] * inverse[0], m[1] * inverse[1], m[2] * inverse[2]), False))
        set_rotation(state, i, product(q, (own[0], -own[1], -own[2], -own[3])))
    put_spin(state, spin, i, limited(spin_now(state, spin, i), most))
