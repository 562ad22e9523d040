"""The stages of a step in which bodies turn.

Bodies turn under torques that hold throughout the step once, after their flight; under those of force systems, which
change within it, beside each stage of the integrator (see flight).
"""

from __future__ import annotations

import math

from ...components import SphereCollider
from ...components.spin import FASTEST_TURN, Spin
from ...framework import Plugin
from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import item, length, replace, scale, triple
from ...systems.forces.stages import is_zero
from ...systems.integration.turning import quaternion_of
from ...systems.integration.turns import ROTATION_DRIFT, ROTATION_KICK, TURNS
from ...systems.shapes.poses import has_unequal_moments
from ...systems.shapes.quaternions import (
    product,
    read_axes,
    rotate,
    rotation_in_space,
    set_rotation,
    turned_tensor,
    write_axes,
)
from .flight import (
    begin_turn,
    drift_of_turn,
    end_turn,
    frame_of,
    inertia_of,
    kick_of_turn,
    principal_moments,
    put_start_back,
    runge_kutta_turn,
    spin_now,
    torque_on,
    turn_alone,
)

SLOW = 1e-4  # rad in a step: what turns slower may fall asleep, if it is dynamic
TOO_FAST = f"a torque is so large for the inertia that Spin.angular_velocity exceeds {FASTEST_TURN:g} rad/s"

spinning = Plugin("stages of rotation")


@part
def turn_about(state, i, angle):
    """A body turns by an angle; in space by a vector, about its direction."""
    if len(angle) == 2:
        state.bodies.rotation[i] += item(angle, 0)
        return
    if length(angle) > 0.0:
        set_rotation(state, i, product(quaternion_of(angle), rotation_in_space(state, i)))


@part
def spin_of(state, spin, i):
    """The angular velocity of a body; in a plane the first component."""
    return triple(zero_of(state), spin_now(state, spin, i))


TURNS_BY = (
    "mass", "quarantined", "sleep_state", "own_levels", "shapes", "spin.inertia", "spin.angular_damping",
    "spin.max_angular_speed", "spin.constant_torque", "spin.applied_torque", "spin.gyration", "spin.gyration_products",
)  # fmt: skip


@spinning.stage(
    after="runge_kutta_stage", records=(Spin, TURNS), reads=(*TURNS_BY, "spin.step_torque"),
    writes=("rotation", "spin.angular_velocity"), needed="on demand",
)  # fmt: skip
def turn_on_way(state, dt, spin, turns):
    """bodies turn beside one stage of the integrator, under the torques of that moment"""
    for i in range(state.first, state.dynamic):
        if not spin.present[i]:
            continue
        if turns.begins:
            begin_turn(state, spin, turns, i)
        if state.bodies.sleep_state[i] > 0 or state.bodies.quarantined[i]:
            continue
        h = dt if spin.angular_damping[i] <= state.heavy_damping else state.heavy_step
        if turns.part == ROTATION_DRIFT:
            drift_of_turn(state, spin, turns, i, h)
        elif turns.part == ROTATION_KICK:
            kick_of_turn(state, spin, turns, i, h)
        else:
            runge_kutta_turn(state, spin, turns, i, dt)


@spinning.stage(
    after="check_flight", records=(Spin, TURNS), reads=TURNS_BY,
    writes=("rotation", "axes", "spin.angular_velocity", "spin.step_torque"),
)  # fmt: skip
def turn_bodies(state, dt, spin, turns):
    """bodies turn"""
    bodies, parts = state.bodies, 1 if len(zero_of(state)) == 2 else 3
    for i in range(state.first, state.moving):
        if not spin.present[i] or bodies.sleep_state[i] > 0:
            continue
        within = turns.within and i < state.dynamic
        if bodies.quarantined[i]:
            if within:
                put_start_back(state, spin, turns, i)
            continue
        if i >= state.dynamic:
            turn_about(state, i, scale(spin_of(state, spin, i), dt))
        elif within:
            end_turn(state, spin, turns, i, dt)
        else:
            turn_alone(state, spin, turns, i, dt)
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
        bodies.inverse_inertia[i] = triple(nothing, (xx, yy, zz))
        return
    xx, yy, zz, xy, xz, yz = turned_tensor(rotation_in_space(state, i), (xx, yy, zz, xy, xz, yz))
    bodies.inverse_inertia[i] = triple(nothing, (xx, yy, zz))
    bodies.inverse_products[i] = triple(nothing, (xy, xz, yz))


@spinning.stage(
    after="check_flight", records=(Spin,),
    reads=(
        "mass", "quarantined", "shapes", "own_levels", "offset", "rotation", "spin.inertia", "spin.angular_velocity",
        "spin.rolling_friction", "spin.gyration", "spin.gyration_products",
    ),
    writes=("spin", "inverse_inertia", "inverse_products", "rolling_radius", "rolling_friction", "turn", "reach"),
    needed="colliders or joints",
)  # fmt: skip
def share_spins(state, dt, spin):
    """how fast bodies spin, and how contacts turn them"""
    bodies, zero, versions = state.bodies, zero_of(state), state.version + state.statics_version  # both only grow
    every = state.has_parts or state.shared_version != versions
    state.spinning, state.shared_version = True, versions
    for i in range(state.count):
        bodies.rolling_friction[i] = spin.rolling_friction[i] if spin.present[i] else 0.0
    for i in range(0 if every else state.first, state.count if every else state.moving):
        w, moves = zero, state.first <= i < state.moving and spin.present[i] and not bodies.quarantined[i]
        if moves:
            w = spin_of(state, spin, i)
        bodies.spin[i], bodies.turn[i] = w, scale(w, dt)
        bodies.inverse_inertia[i], bodies.inverse_products[i], bodies.rolling_radius[i] = zero, zero, 0.0
        if moves and i < state.dynamic:
            write_inverse_inertia(state, spin, i)


@spinning.stage(
    after="check_flight", records=(Spin, SphereCollider),
    reads=("shapes", "levels", "offset", "inverse_inertia", "sphere_collider.radius"),
    writes=("rolling_radius",), needed="colliders",
)  # fmt: skip
def find_round(state, dt, spin, sphere):
    """which bodies roll: contacts push on their centre, and turn them by friction alone"""
    bodies, d = state.bodies, len(zero_of(state))
    for i in range(state.first, state.moving):
        if bodies.levels[0, i] < 0 or not (spin.present[i] and sphere.present[i]):
            continue
        shape, inverse, others = bodies.levels[0, i], bodies.inverse_inertia[i], bodies.inverse_products[i]
        several = state.several_levels and bodies.levels[state.level_count - 1, i] != shape  # another one decides
        if several or not is_zero(state.colliders.offset[state.shapes.slots[shape], i]):
            continue
        alike = is_zero(others) and item(inverse, 0) == item(inverse, 1) == item(inverse, d - 1)
        if d == 2 or i >= state.dynamic or alike:
            bodies.rolling_radius[i] = sphere.radius[i]


@part
def turn_with_contacts(state, spin, i, angle):
    """A body turns by ``angle``, as its contacts ask. In space its spin keeps the energy that it has."""
    if len(angle) == 2:
        turn_about(state, i, angle)
        return
    principal, _, own = principal_moments(state, spin, i)
    w = spin_now(state, spin, i)
    before = rotate(frame_of(state, i, own), w, True)
    turn_about(state, i, angle)
    if principal[0] == principal[1] == principal[2]:
        return
    after, old, new = rotate(frame_of(state, i, own), w, True), 0.0, 0.0
    for k in range(3):
        old += principal[k] * before[k] * before[k]
        new += principal[k] * after[k] * after[k]
    for k in range(3 if new > 0.0 else 0):
        spin.angular_velocity[i, k] *= math.sqrt(old / new)


@spinning.stage(
    after="put_back",
    records=(Spin,),
    reads=("spin", "turn", "solver", "quarantined", "spin.max_angular_speed"),
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
        struck = state.impacts.logged > 0 and bodies.impact_count[i] > 0
        if struck and has_unequal_moments(state, i):
            read_axes(state, i)  # as impacts have turned it
        tumbled = state.solver.joints.active > 0 or state.solver.lopsided
        if tumbled and not struck:  # its spin is that of its inertia as it is turned now
            turn_about(state, i, further)
        else:
            turn_with_contacts(state, spin, i, further)
        write_axes(state, i)
        size, most = length(spin_of(state, spin, i)), spin.max_angular_speed[i]
        for k in range(parts if size > most else 0):
            spin.angular_velocity[i, k] *= most / size


@spinning.stage(
    before="update_sleep", records=(Spin, TURNS),
    reads=("spin.angular_velocity", "spin.constant_torque", "spin.applied_torque", "spin.step_torque"),
    writes=("rest_steps",), needed="sleeping",
)  # fmt: skip
def keep_spinning_awake(state, dt, spin, turns):
    """what turns, or is to, does not fall asleep"""
    for i in range(state.first, state.moving):
        if spin.present[i]:
            pushed = False
            for k in range(1 if len(zero_of(state)) == 2 else 3):
                pushed |= torque_on(state, spin, turns, i, k) != 0.0
            if pushed or length(spin_of(state, spin, i)) * dt > (SLOW if i < state.dynamic else 0.0):
                state.bodies.rest_steps[i] = 0


@spinning.stage(
    after="update_sleep", records=(Spin,), reads=("sleep_state",), writes=("spin.angular_velocity",), needed="sleeping",
)  # fmt: skip
def stop_sleepers(state, dt, spin):
    """what falls asleep turns no more"""
    for i in range(state.first, state.dynamic):
        if spin.present[i] and state.bodies.sleep_state[i] > 0:
            for k in range(1 if len(zero_of(state)) == 2 else 3):
                spin.angular_velocity[i, k] = 0.0
