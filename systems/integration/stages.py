"""The stages of INTEGRATION: keep the start of the step, fly freely, note the path.

Damping is exact for a constant force in every method: it enters as the integrating factor e^(-c h), and what
multiplies accelerations are the phi functions of exponential integrators (Hochbruck & Ostermann, Acta Numerica 2010);
for c = 0 they are the ordinary coefficients.
"""

from __future__ import annotations

import math

from ...components.rigid_body import FASTEST
from ...framework.compilation import inlined, part
from ...framework.elementary import exp, expm1
from ...framework.jit.records.record_type import zero_of
from ...framework.schedule.stages import Rows
from ...framework.vectors import add, add_scaled, divided, dot, item, scale, sub
from ..codes import CHECK_FLIGHT, OK
from ..forces.stages import within
from ..quarantine.columns import are_columns_sound
from ..records import CURVES, UNDO_FORCE
from ..step_stages import KEEPS_FORCE, KEEPS_START, LARGEST_FLOAT

LINE, PARABOLA, CUBIC = 1, 2, 3  # degree of the path within the step
CUBE_ROOT_OF_2 = 1.2599210498948732  # Yoshida's

UNMOVED = 1e-6  # of its extent, at least of a metre: a body that should move by more, and does not, is too far out
NEAR_ORIGIN = 2.0**33  # m: up to here numbers are less than 2 UNMOVED apart


@inlined
def phi1(z):
    """(e^z - 1) / z."""
    return 1.0 if z == 0.0 else expm1(z) / z


@part
def phi2(z):
    """(phi1(z) - 1) / z; a series near zero, where the difference cancels."""
    if abs(z) > 0.5:
        return (phi1(z) - 1.0) / z
    total, term = 0.0, 1.0
    for n in range(2, 18):
        term /= n
        total += term
        term *= z
    return total


@part
def phi3(z):
    """(phi2(z) - 1/2) / z."""
    if abs(z) > 0.5:
        return (phi2(z) - 0.5) / z
    total, term = 0.0, 0.5
    for n in range(3, 19):
        term /= n
        total += term
        term *= z
    return total


def keep_start(state, dt):
    """previous_position and start_velocity are the state at the start of the step; for going back, kept_previous is the
    start of the one before."""
    bodies, first, kept = state.bodies, state.first, state.kept_rows
    state.path_degree, state.drifted = state.usual_path_degree, False
    state.flight_usual, state.flight_seen = True, 0
    previous, position = bodies.previous_position, bodies.position
    start, velocity = bodies.start_velocity, bodies.linear_velocity
    # Of sleepers and static bodies the two are equal, see box_statics.
    if state.others_write:  # every column is kept
        for i in range(first, kept):
            previous[i] = position[i]
    else:
        state.kept |= KEEPS_START
        for i in range(first, kept):
            bodies.kept_previous[i] = previous[i]
            previous[i] = position[i]
    turned, rotation, width = bodies.previous_rotation, bodies.rotation, 1 if len(zero_of(state)) == 2 else 4
    if len(turned) > 0 and len(rotation) > 0:
        start_row = first if state.boxed_version == state.statics_version else 0  # else other rows sleep
        for k in range(width * start_row, width * kept):
            turned[k] = rotation[k]
    if state.limits_speed:  # systems may have pushed since the forces were summed
        for i in range(first, state.dynamic):
            if not bodies.quarantined[i]:
                velocity[i] = within(velocity[i], zero_of(state), bodies.max_linear_speed[i])
    for i in range(first, state.moving):
        start[i] = velocity[i]
    return 0


@inlined
def is_near_origin(x, v):
    """Whether a body is neither far out nor fast, for every axis: one comparison, which is false if either is nan."""
    near = True
    for k in range(len(x)):
        near &= abs(item(x, k)) + abs(item(v, k)) <= NEAR_ORIGIN
    return near


@part
def any_damping(state):
    """Whether any dynamic body is damped."""
    bodies = state.bodies
    damping, out, damped = bodies.total_damping, bodies.quarantined, False
    for i in range(state.first, state.dynamic if len(damping) > 0 else 0):
        damped |= (damping[i] != 0.0) & (not out[i])
    return damped


def drift(state, h):
    """x' = x + h v if nothing acts on any body and none is damped: all standard integrators do the same then.

    The stages of the integrator that follow do nothing in that case.
    """
    bodies, dynamic = state.bodies, state.dynamic
    state.drifted = state.unforced and not state.others_write and not any_damping(state)
    if state.drifted:
        state.path_degree = LINE
        position, velocity = bodies.position, bodies.linear_velocity
        usual = True
        for i in range(state.first, dynamic):
            x = add_scaled(position[i], velocity[i], h)
            position[i] = x
            usual &= is_near_origin(x, velocity[i])
        state.flight_usual, state.flight_seen = usual, dynamic
    return 0


@inlined
def euler(state, h, with_new_velocity):
    """v' = v e^(-c h) + a (1 - e^(-c h)) / c; x' = x + h v' or x + h v."""
    if state.drifted:
        return 0
    bodies, dynamic = state.bodies, state.dynamic
    position, velocity, force = bodies.position, bodies.linear_velocity, bodies.force
    inverse_mass, damping = bodies.inverse_mass, bodies.total_damping
    damped, usual = any_damping(state), True
    for i in range(dynamic if damped else state.first, dynamic):  # no exponentials and no branches in this loop
        old = velocity[i]
        new = add(old, scale(scale(force[i], inverse_mass[i]), h))
        x = add_scaled(position[i], new if with_new_velocity else old, h)
        velocity[i], position[i] = new, x
        usual &= is_near_origin(x, new)
    state.flight_usual, state.flight_seen = usual, 0 if damped else dynamic
    for i in range(state.first, dynamic if damped else 0):
        c, decay, gain = damping[i], 1.0, h
        if c != 0.0:
            decay, gain = exp(-c * h), h * phi1(-c * h)
        old = velocity[i]
        new = add(scale(old, decay), scale(scale(force[i], inverse_mass[i]), gain))
        velocity[i] = new
        position[i] = add_scaled(position[i], new if with_new_velocity else old, h)
    return 0


def explicit_euler(state, h):
    """Velocity and position, the latter with the old velocity."""
    return euler(state, h, False)


def semi_implicit_euler(state, h):
    """Velocity first, position with the new one."""
    return euler(state, h, True)


def verlet_drift(state, h):
    """x' = x + v h phi1 + a h^2 phi2; v' = v e^(-c h) + a h phi1; keeps a where forces change within the step.

    Bodies with damping above ``state.heavy_damping`` take a step of ``state.heavy_step`` instead.
    """
    if state.drifted:
        return 0
    bodies, light_h, keep = state.bodies, h, state.force_changes
    position, velocity, force = bodies.position, bodies.linear_velocity, bodies.force
    damping, acceleration = bodies.total_damping, bodies.acceleration
    for i in range(state.first, state.dynamic):
        c = damping[i]
        h = light_h if c <= state.heavy_damping else state.heavy_step
        decay, first, second = 1.0, 1.0, 0.5
        if c != 0.0:
            decay, first, second = exp(-c * h), phi1(-c * h), phi2(-c * h)
        v, a = velocity[i], scale(force[i], bodies.inverse_mass[i])
        position[i] = add_scaled(position[i], add(scale(v, first), scale(a, h * second)), h)
        velocity[i] = add(scale(v, decay), scale(a, h * first))
        if keep:
            acceleration[i] = a
    return 0


@part
def kick_gain(z, h):
    """By how much the change of the acceleration changes the velocity in a Verlet step.

    With damping, z = -c h, the first weighs phi2(z) / phi1(-z) and the second the rest of phi1(z): those alone are
    exact for a constant force and make the step its own adjoint, which keeps it reversible and lets Yoshida's
    composition reach the fourth order (derived; phi2(z) + phi2(-z) = phi1(z) phi1(-z)).
    """
    return 0.5 * h if z == 0.0 else h * (phi1(z) - phi2(z) / phi1(-z))


def verlet_kick(state, h):
    """The second half: the mean of both accelerations instead of the first."""
    bodies, light_h = state.bodies, h
    velocity, force, damping = bodies.linear_velocity, bodies.force, bodies.total_damping
    for i in range(state.first, state.dynamic):
        h = light_h if damping[i] <= state.heavy_damping else state.heavy_step
        gain = kick_gain(-damping[i] * h, h)
        change = sub(scale(force[i], bodies.inverse_mass[i]), bodies.acceleration[i])
        velocity[i] = add_scaled(velocity[i], change, gain)
    return 0


@part
def runge_kutta_weights(z):
    """(those of the accelerations of stages 1, 2 or 3, and 4; of the velocity after the step and after half of it; of
    an acceleration in half a step) with damping, z = -c h."""
    if z == 0.0:
        return 1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0, 1.0, 1.0, 1.0
    p1, p2, p3 = phi1(z), phi2(z), phi3(z)
    f1, f2, f3 = p1 - 3.0 * p2 + 4.0 * p3, p2 - 2.0 * p3, 4.0 * p3 - p2
    return f1, f2, f3, exp(z), exp(0.5 * z), phi1(0.5 * z)


def runge_kutta_stage(state, h):
    """Take the acceleration of stage ``state.rk_stage`` in and go to the state of the next; after stage 3 that is the
    result.

    acceleration holds a1, rk_middle the velocity of stage 2; rk_speeds, rk_kicks weighted sums of velocities and
    accelerations.
    """
    bodies, stage = state.bodies, state.rk_stage
    position, velocity = bodies.position, bodies.linear_velocity
    x0, v0 = bodies.previous_position, bodies.start_velocity
    first, middle, speeds, kicks = bodies.acceleration, bodies.rk_middle, bodies.rk_speeds, bodies.rk_kicks
    for i in range(state.first, state.dynamic):
        f1, f2, f3, decay, half_decay, half_gain = runge_kutta_weights(-bodies.total_damping[i] * h)
        a, v = scale(bodies.force[i], bodies.inverse_mass[i]), velocity[i]
        if stage == 0:
            first[i], speeds[i], kicks[i] = a, v, scale(a, f1)
            position[i] = add_scaled(x0[i], v, 0.5 * h)
            middle[i] = add(scale(v0[i], half_decay), scale(a, 0.5 * h * half_gain))
            velocity[i] = middle[i]
        elif stage == 1:
            speeds[i] = add_scaled(speeds[i], v, 2.0)
            kicks[i] = add_scaled(kicks[i], a, 2.0 * f2)
            position[i] = add_scaled(x0[i], v, 0.5 * h)
            velocity[i] = add(scale(v0[i], half_decay), scale(a, 0.5 * h * half_gain))
        elif stage == 2:
            speeds[i] = add_scaled(speeds[i], v, 2.0)
            kicks[i] = add_scaled(kicks[i], a, 2.0 * f2)
            position[i] = add_scaled(x0[i], v, h)
            velocity[i] = add(scale(middle[i], half_decay), scale(sub(scale(a, 2.0), first[i]), 0.5 * h * half_gain))
        else:
            position[i] = add(x0[i], scale(add(speeds[i], v), h / 6.0))
            velocity[i] = add(scale(v0[i], decay), scale(add_scaled(kicks[i], a, f3), h))
    return 0


def first_half_kick(state, h):
    """Event-driven: the damping of the first half step, then the flight on a parabola under the forces of the start."""
    if state.drifted:
        return 0
    bodies, damped = state.bodies, False
    position, velocity, damping = bodies.position, bodies.linear_velocity, bodies.total_damping
    for i in range(state.first, state.dynamic):
        decay = 1.0
        if damping[i] != 0.0:
            decay, damped = exp(-0.5 * damping[i] * h), damped or not bodies.quarantined[i]
        a, v = scale(bodies.force[i], bodies.inverse_mass[i]), scale(velocity[i], decay)
        bodies.flight_velocity[i] = v
        bodies.acceleration[i] = scale(a, 0.5)
        position[i] = add_scaled(position[i], add_scaled(v, a, 0.5 * h), h)
        velocity[i] = add_scaled(v, a, h)
    state.damped = damped
    return 0


def second_half_kick(state, h):
    """The mean of the forces at both ends in place of the first, and the damping of the second half step."""
    bodies = state.bodies
    if state.drifted or not (state.force_changes or state.damped):
        return 0
    velocity, force, damping = bodies.linear_velocity, bodies.force, bodies.total_damping
    for i in range(state.first, state.dynamic):
        decay = exp(-0.5 * damping[i] * h) if damping[i] != 0.0 else 1.0
        change = sub(scale(scale(force[i], 0.5), bodies.inverse_mass[i]), bodies.acceleration[i])
        velocity[i] = scale(add_scaled(velocity[i], change, h), decay)
    return 0


@part
def has_pushes(state):
    """Whether forces of this step are to be cleared, of which no other copy is kept."""
    return state.pushed and not state.others_write and len(state.bodies.step_force) > 0


ROOM_FOR_PUSHES = (Rows("bodies", UNDO_FORCE, lambda s: s.count if has_pushes(s) else 0),)
ROOM_FOR_PATHS = (Rows("bodies", CURVES, lambda s: s.count if s.path_degree > LINE else 0),)


def end_flight(state, dt):
    """Limits of speed, kinematic bodies, and the forces of this step, which have done their work."""
    bodies, dynamic = state.bodies, state.dynamic
    position, velocity = bodies.position, bodies.linear_velocity
    force = bodies.step_force
    pushed = (state.pushed or state.others_write) and len(force) > 0
    if state.limits_speed:
        state.flight_usual, state.flight_seen = True, 0
        for i in range(state.first, dynamic):
            limit = bodies.max_linear_speed[i]
            velocity[i] = within(velocity[i], zero_of(state), limit)
            position[i] = within(position[i], bodies.previous_position[i], limit * dt)
    for i in range(dynamic, state.moving):
        position[i] = add_scaled(position[i], velocity[i], dt)
    if has_pushes(state):
        state.kept |= KEEPS_FORCE
        for i in range(state.force_first, dynamic):
            bodies.kept_step_force[i] = force[i]
    for i in range(state.force_first, dynamic if pushed else 0):
        force[i] = zero_of(state)
    state.forces_summed, state.moved = False, True
    state.motion_version += 1
    return 0


@part
def is_out_of_range(state, i, dt):
    """Whether a body is nowhere, too fast, or where numbers are so far apart that its motion along an axis is lost."""
    bodies, astray = state.bodies, False
    x, before, v = bodies.position[i], bodies.previous_position[i], bodies.linear_velocity[i]
    extent = max(1.0, bodies.min_extent[i] if len(bodies.min_extent) > 0 else 0.0)
    for k in range(len(x)):
        astray |= not (abs(item(x, k)) <= LARGEST_FLOAT and abs(item(v, k)) <= FASTEST)
        astray |= item(x, k) == item(before, k) and abs(item(v, k)) * dt > UNMOVED * extent
    return astray


def check_flight(state, dt):
    """Whether each body is where it can be, with a speed that it can have: else Python puts it back and takes it out,
    before it touches another.

    Where code of the game has run since the step began, columns are looked at once more.
    """
    bodies, usual = state.bodies, state.flight_usual
    position, velocity = bodies.position, bodies.linear_velocity
    first, moving = state.first, state.moving
    for i in range(max(state.flight_seen, first), moving):
        usual &= is_near_origin(position[i], velocity[i])
    state.flight_usual = usual
    if state.quarantining or (state.others_write and not are_columns_sound(state)):
        return CHECK_FLIGHT
    for i in range(moving if usual else first, moving):
        if is_out_of_range(state, i, dt):
            return CHECK_FLIGHT
    return OK


def note_path(state, dt):
    """x(t) = x0 + p1 t + p2 t^2 + p3 t^3 for the dynamic bodies, x0 + v t for the kinematic ones."""
    bodies, degree, dynamic = state.bodies, state.path_degree, state.dynamic
    first, moving = state.first, state.moving
    v0, v1, path = bodies.start_velocity, bodies.linear_velocity, bodies.path_velocity
    for i in range(first, moving if state.sweeping else 0):
        bodies.origin[i] = bodies.previous_position[i]
    for i in range(first, moving):
        path[i] = v1[i] if degree == LINE and not state.moves_with_old_velocity else v0[i]
    if degree == LINE:
        return 0
    second, third, zero = bodies.path_second, bodies.path_third, zero_of(state)
    for i in range(dynamic, moving):
        second[i], third[i] = zero, zero
    for i in range(first, dynamic):
        travel = sub(bodies.position[i], bodies.previous_position[i])
        if state.flies:  # event-driven: the parabola itself
            path[i], second[i], third[i] = bodies.flight_velocity[i], bodies.acceleration[i], zero
            if state.limits_speed:  # bodies clamped by max_linear_speed follow a straight path
                speed, bend = math.sqrt(dot(path[i], path[i])), math.sqrt(dot(second[i], second[i]))
                if speed + 2.0 * dt * bend > bodies.max_linear_speed[i]:
                    path[i], second[i] = divided(travel, dt), zero
        elif degree == PARABOLA:
            second[i] = divided(sub(travel, scale(v0[i], dt)), dt * dt)
            third[i] = zero
        else:  # Hermite: both ends and both velocities
            both = sub(scale(travel, 3.0), scale(add(scale(v0[i], 2.0), v1[i]), dt))
            second[i] = divided(both, dt * dt)
            third[i] = divided(sub(scale(add(v0[i], v1[i]), dt), scale(travel, 2.0)), state.dt_cubed)
    return 0
