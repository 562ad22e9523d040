"""The stages in which zones act. Each goes through all bodies for each of its zones: a box test for each of them."""

from __future__ import annotations

import collections
import math

from ...components.spin import Spin
from ...framework import Plugin
from ...framework.compilation import part
from ...framework.elementary import exp, power
from ...framework.jit.records.record_type import zero_of
from ...framework.jit.records.schema import Schema, floats, integer, ints, table, vectors
from ...framework.vectors import add, add_scaled, item, length, replace, scale, sub
from ...systems.integration.stages import phi1
from ...systems.integration.turns import TURNS
from ...systems.narrow_phase.stages import layers_meet
from ...systems.parts.rows import owner_of
from ...systems.shapes.dispatch import evaluate, half_extents, write_rotated
from ...systems.shapes.quaternions import write_axes
from ...systems.shapes.surfaces import along_world
from .components import Field, Water, Wind
from .displacement import submerged

acting = Plugin("zones")

# By row of the bodies: whether this zone has acted on it; of all water that it is in the mass that it displaces, the
# rate at which that slows it, that at the start of the step, and the flow times the rate. torque: about its position,
# three numbers, of which a plane uses the first. sums: of this step's forces so far.
ZONES = Schema(
    "Zones", seen=ints(), displaced=floats(unit="kg"), rate=floats(unit="1/s"), first_rate=floats(unit="1/s"),
    flow=vectors(unit="m/s^2"), torque=table("float64", 3, unit="N m"), sums=integer(),
)  # fmt: skip
PLACES = "position", "quarantined", "levels", "shapes", "offset", "rotation", "sensor", "layer", "mask", "group"


@part
def has_room(state, zones):
    """Whether there are rows for all bodies; else they are made, and the stage runs again."""
    rows = min(len(zones.displaced), len(zones.rate), len(zones.first_rate), len(zones.flow), len(zones.torque))
    return min(rows, len(zones.seen)) >= state.count


@part
def has_lifted(state, zones):
    """Whether water has acted in this step."""
    return zones.sums > 0 and has_room(state, zones)


@part
def centre_of(state, i):
    return add(state.bodies.position[i], state.bodies.offset[i])


@part
def follow(state, i):
    """The shape of row i is as it is turned at this moment, perhaps within the step: the broad phase comes after it."""
    bodies, shape = state.bodies, state.bodies.shape[i]
    if shape >= 0:
        at = state.colliders.offset[state.shapes.slots[shape], i]
        if state.rotated:
            write_axes(state, i)
            at = along_world(state, i, at)
            write_rotated(state, shape, i)
        bodies.offset[i] = at


@part
def is_zone(state, j):
    if state.bodies.shape[j] < 0 or state.bodies.quarantined[j]:
        return False
    follow(state, j)
    return True


@part
def is_in(state, j, half, i):
    """Whether the shape of row i, if it is none of a sensor, touches that of a zone j with these half extents."""
    bodies = state.bodies
    if bodies.shape[i] < 0 or bodies.quarantined[i] or owner_of(state, i) == owner_of(state, j):
        return False
    d = sub(centre_of(state, i), centre_of(state, j))
    own, apart = half_extents(state, bodies.shape[i], i), False
    for k in range(len(d)):
        apart |= abs(item(d, k)) > item(half, k) + item(own, k)
    if apart or state.colliders.sensor[bodies.collider_slot[i], i] or not layers_meet(state, j, i):
        return False
    return evaluate(state, bodies.shape[j], j, bodies.shape[i], i, d)[0]


@part
def begin_zones(state):
    for i in range(state.force_first, state.dynamic):
        follow(state, i)
    return state.count


@part
def begin_zone(state, zones):
    """No body has been found in this zone yet."""
    for i in range(state.force_first, state.dynamic):
        zones.seen[i] = 0


@part
def is_first(state, zones, i):
    """Whether no other part of the body of row i has been found in this zone; from now on one has."""
    o = owner_of(state, i)
    first = state.force_first <= o < state.dynamic and zones.seen[o] == 0
    if first:
        zones.seen[o] = 1
    return first


@acting.stage(
    after="sum_forces", records=(Wind, ZONES), reads=(*PLACES, "wind.force"), writes=("force",), needed="colliders"
)
def blow(state, dt, wind, zones):
    """wind pushes the bodies in it"""
    bodies = state.bodies
    for j in range(begin_zones(state) if has_room(state, zones) else 0):
        if wind.present[j] and is_zone(state, j):
            begin_zone(state, zones)
            half = half_extents(state, bodies.shape[j], j)
            for i in range(state.force_first, state.dynamic):
                if is_in(state, j, half, i) and is_first(state, zones, i):
                    o = owner_of(state, i)
                    bodies.force[o] = add(bodies.force[o], wind.force[j])
    return state.count


@acting.stage(
    after="sum_forces", records=(Field, ZONES),
    reads=(*PLACES, "mass", "field.strength", "field.falloff", "field.core"), writes=("force",), needed="colliders",
)  # fmt: skip
def attract(state, dt, field, zones):
    """fields attract or repel the bodies in them"""
    bodies = state.bodies
    for j in range(begin_zones(state) if has_room(state, zones) else 0):
        if field.present[j] and is_zone(state, j):
            begin_zone(state, zones)
            half, core = half_extents(state, bodies.shape[j], j), field.core[j]
            for i in range(state.force_first, state.dynamic):
                if is_in(state, j, half, i) and is_first(state, zones, i):
                    o = owner_of(state, i)
                    way = sub(centre_of(state, j), bodies.position[o])
                    by = power(max(length(way), core), -(field.falloff[j] + 1.0))
                    by *= bodies.mass[o] * field.strength[j]
                    bodies.force[o] = add_scaled(bodies.force[o], way, by)
    return state.count


@part
def overlap_across(state, j, half, i, up):
    """Which part of the box around a shape is within that of the zone, along the axes that are level."""
    d, own, share = sub(centre_of(state, i), centre_of(state, j)), half_extents(state, state.bodies.shape[i], i), 1.0
    for k in range(len(d)):
        if up[k] == 0.0:
            low = max(item(d, k) - item(own, k), -item(half, k))
            share *= max(0.0, min(item(d, k) + item(own, k), item(half, k)) - low) / (2.0 * item(own, k))
    return share


@part
def upwards(state):
    """The unit vector against gravity, three numbers, and how strong it is; without gravity the last axis is up."""
    gravity = state.gravity[0]
    size, d = length(gravity), len(gravity)
    if size == 0.0:
        return (0.0, 1.0, 0.0), 0.0
    z = -item(gravity, d - 1) / size if d == 3 else 0.0
    return (-item(gravity, 0) / size, -item(gravity, 1) / size, z), size


# Of a zone of water: its row and half extents, where up is, its heights along that, and how strong gravity is.
Surface = collections.namedtuple("Surface", "zone half up top bottom gravity")


@part
def surface_of(state, j, up, gravity):
    """Of the zone in row j. What has no end upwards is an open sea, level with its centre."""
    half, centre, height, reach = half_extents(state, state.bodies.shape[j], j), centre_of(state, j), 0.0, 0.0
    for k in range(len(half)):
        height += item(centre, k) * up[k]
        reach += item(half, k) * abs(up[k]) if up[k] != 0.0 else 0.0
    return Surface(j, half, up, height + reach if reach < math.inf else height, height - reach, gravity)


@part
def add_water(state, water, zones, i, surface):
    """What a body displaces of a zone, and how that turns it."""
    bodies, o = state.bodies, owner_of(state, i)
    j, up = surface.zone, surface.up
    volume, middle = submerged(state, i, up, surface.top, surface.bottom)
    if not volume > 0.0:  # nor is there one of what has no extent
        return
    mass = water.density[j] * volume * overlap_across(state, j, surface.half, i, up)
    rate, arm = water.drag[j] * mass / bodies.mass[o], sub(bodies.position[i], bodies.position[o])
    zones.displaced[o] += mass
    zones.rate[o] += rate
    zones.flow[o] = add_scaled(zones.flow[o], water.flow[j], rate)
    lift, last = surface.gravity * mass * bodies.gravity_scale[o], len(arm) - 1
    x, y = middle[0] + item(arm, 0), middle[1] + item(arm, 1)
    z = middle[2] + (item(arm, last) if last == 2 else 0.0)
    if last == 1:
        zones.torque[o, 0] += lift * (x * up[1] - y * up[0])
    else:
        zones.torque[o, 0] += lift * (y * up[2] - z * up[1])
        zones.torque[o, 1] += lift * (z * up[0] - x * up[2])
        zones.torque[o, 2] += lift * (x * up[1] - y * up[0])


@part
def forget_torques(turns):
    for i in range(len(turns.lifting)):
        turns.lifting[i, 0] = turns.lifting[i, 1] = turns.lifting[i, 2] = 0.0


@acting.stage(after="limit_velocities", records=(ZONES, TURNS), needed="dynamic bodies")
def begin_water(state, dt, zones, turns):
    """water has not acted in this step"""
    zones.sums = 0
    forget_torques(turns)


@part
def drag_on(state, dt, zones, i):
    """The acceleration by drag, beside what the integrator makes of ``first_rate`` as of damping: the flow, and what
    the rate has changed by since. In an event-driven world, where damping is a kick, all of it, as at the start.

    Changes are slowed by themselves, so that none throws the body back.
    """
    bodies, rate, first = state.bodies, zones.rate[i], zones.first_rate[i]
    v, change, drawn = bodies.linear_velocity[i], rate - first, zones.flow[i]
    if change != 0.0 and rate > 0.0:
        drawn = scale(drawn, (first + change * phi1(-abs(change) * dt)) / rate)
    drawn = add_scaled(drawn, v, -change * phi1(-abs(change) * dt))
    return add_scaled(drawn, bodies.start_velocity[i] if zones.sums > 1 else v, -first) if state.flies else drawn


@acting.stage(
    after="sum_forces", records=(Water, ZONES),
    reads=(
        *PLACES, "linear_velocity", "start_velocity", "mass", "gravity_scale", "water.density", "water.drag",
        "water.flow",
    ),
    writes=("force",), needed="colliders",
)  # fmt: skip
def lift(state, dt, water, zones):
    """water lifts the bodies in it, and draws them along"""
    bodies, nothing = state.bodies, zero_of(state)
    if not has_room(state, zones):
        return state.count
    zones.sums += 1
    for i in range(state.force_first, state.dynamic):
        zones.displaced[i], zones.rate[i], zones.flow[i] = 0.0, 0.0, nothing
        zones.torque[i, 0] = zones.torque[i, 1] = zones.torque[i, 2] = 0.0
    up, g = upwards(state)
    for j in range(begin_zones(state)):
        if not (water.present[j] and is_zone(state, j)):
            continue
        surface = surface_of(state, j, up, g)
        for i in range(state.force_first, state.dynamic):
            o = owner_of(state, i)
            if state.force_first <= o < state.dynamic and is_in(state, j, surface.half, i):
                add_water(state, water, zones, i, surface)
    for i in range(state.force_first, state.dynamic):
        if zones.sums == 1:
            zones.first_rate[i] = zones.rate[i]
        if zones.displaced[i] > 0.0 or zones.first_rate[i] > 0.0:
            force, by = bodies.force[i], g * zones.displaced[i] * bodies.gravity_scale[i]
            for k in range(len(force)):
                force = replace(force, k, item(force, k) + by * up[k])
            bodies.force[i] = add_scaled(force, drag_on(state, dt, zones, i), bodies.mass[i])
    return state.count


@acting.stage(after="sum_forces", records=(ZONES, TURNS), needed="dynamic bodies")
def turn_by_lift(state, dt, zones, turns):
    """what floats rights itself"""
    for i in range(state.force_first, state.dynamic if has_lifted(state, zones) and len(turns.lifting) > 0 else 0):
        for k in range(3):
            turns.lifting[i, k] = zones.torque[i, k]


@part
def braked_share(state, dt, zones, i):
    """Of an impulse that acts throughout the step, what is left of it at the end, after drag and damping."""
    own, rate = state.bodies.linear_damping[i], zones.first_rate[i]
    return phi1(-rate * dt) * exp(-0.5 * own * dt) if state.flies else phi1(-(own + rate) * dt)


@acting.stage(
    after="keep_start", records=(ZONES,), reads=("linear_damping",), writes=("total_damping", "inverse_mass"),
    needed="dynamic bodies",
)  # fmt: skip
def brake(state, dt, zones):
    """water slows what it is around, as damping does"""
    bodies, wet = state.bodies, has_lifted(state, zones)
    for i in range(state.first, state.dynamic):
        rate = zones.first_rate[i] if wet else 0.0
        if state.flies and rate > 0.0:
            bodies.inverse_mass[i] *= phi1(-rate * dt)
            rate = 0.0
        bodies.total_damping[i] = bodies.linear_damping[i] + rate


@part
def weigh_dry(state):
    """1 / mass as it was before ``brake``."""
    bodies = state.bodies
    for i in range(state.first, state.dynamic):
        o = owner_of(state, i)
        if bodies.inverse_mass[i] > 0.0 and state.first <= o < state.dynamic:
            bodies.inverse_mass[i] = 1.0 / bodies.mass[o]


@acting.stage(before="end_flight", records=(ZONES,), reads=("mass",), writes=("inverse_mass",), needed="colliders")
def leave_water(state, dt, zones):
    """impacts are too short for drag"""
    if has_lifted(state, zones) and state.flies:
        weigh_dry(state)


@acting.stage(
    before="gather", records=(ZONES,), reads=("linear_damping",), writes=("inverse_mass",), needed="colliders"
)
def weigh_wet(state, dt, zones):
    """contacts and joints push throughout the step, and drag slows what they do: as much as what forces do"""
    bodies = state.bodies
    for i in range(state.first, state.dynamic if has_lifted(state, zones) else 0):
        o = owner_of(state, i)
        if state.first <= o < state.dynamic and zones.first_rate[o] > 0.0:
            bodies.inverse_mass[i] *= braked_share(state, dt, zones, o)


@acting.stage(after="put_back", records=(ZONES, TURNS), reads=("mass",), writes=("inverse_mass",), needed="colliders")
def end_water(state, dt, zones, turns):
    """1 / mass again; what floats at rest may sleep"""
    if has_lifted(state, zones):
        weigh_dry(state)
        forget_torques(turns)


@acting.stage(
    after="keep_start", records=(Spin, ZONES), reads=("sleep_state", "quarantined"),
    writes=("spin.angular_velocity",), needed="colliders",
)  # fmt: skip
def turn_in_water(state, dt, spin, zones):
    """water slows the turning of the bodies that float in it"""
    bodies, plane = state.bodies, len(zero_of(state)) == 2
    for i in range(state.first, state.dynamic if has_lifted(state, zones) else 0):
        if not spin.present[i] or bodies.sleep_state[i] > 0 or bodies.quarantined[i] or zones.first_rate[i] == 0.0:
            continue
        decay = exp(-zones.first_rate[i] * dt)
        for k in range(1 if plane else 3):
            spin.angular_velocity[i, k] *= decay
