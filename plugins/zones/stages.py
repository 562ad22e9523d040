"""The stages in which zones act. Each goes through all bodies for each of its zones: a box test for each of them."""

from __future__ import annotations

import collections

from ...components.spin import Spin
from ...framework import Plugin
from ...framework.compilation import part
from ...framework.elementary import exp, power
from ...framework.jit.records.record_type import zero_of
from ...framework.jit.records.schema import Schema, floats, integer, ints, table, vectors
from ...framework.vectors import add, add_scaled, item, length, replace, scale, sub
from ...systems.integration.stages import phi1
from ...systems.narrow_phase.stages import layers_meet
from ...systems.parts.rows import owner_of
from ...systems.shapes.dispatch import evaluate, half_extents, write_rotated
from ...systems.shapes.surfaces import along_world
from .components import Field, Water, Wind
from .displacement import submerged

acting = Plugin("zones")

# By row of the bodies: whether this zone has acted on it; of all water that it is in the mass that it displaces, the
# rate at which that slows it, and the flow times that rate. torque: about its position, three numbers, the last one in
# a plane. step: of these.
ZONES = Schema(
    "Zones", seen=ints(), displaced=floats(unit="kg"), rate=floats(unit="1/s"), flow=vectors(unit="m/s^2"),
    torque=table("float64", 3, unit="N m"), step=integer(),
)  # fmt: skip
PLACES = "position", "quarantined", "levels", "shapes", "offset", "rotation", "sensor", "layer", "mask", "group"


@part
def has_room(state, zones):
    """Whether there are rows for all bodies; else they are made, and the stage runs again."""
    rows = min(len(zones.seen), len(zones.displaced), len(zones.rate), len(zones.flow), len(zones.torque))
    return rows >= state.count


@part
def centre_of(state, i):
    return add(state.bodies.position[i], state.bodies.offset[i])


@part
def follow(state, i):
    """The shape of row i is as it is turned at this moment: the broad phase comes after the flight."""
    bodies, shape = state.bodies, state.bodies.shape[i]
    if shape >= 0:
        at = state.colliders.offset[state.shapes.slots[shape], i]
        if state.rotated:
            at = along_world(state, i, at)
            write_rotated(state, shape, i, state.rotated)
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
    zones.torque[o, 0] += lift * (y * up[2] - z * up[1])
    zones.torque[o, 1] += lift * (z * up[0] - x * up[2])
    zones.torque[o, 2] += lift * (x * up[1] - y * up[0])


@acting.stage(
    after="sum_forces", records=(Water, ZONES),
    reads=(
        *PLACES, "linear_velocity", "mass", "gravity_scale", "water.density", "water.drag", "water.flow",
    ),
    writes=("force",), needed="colliders",
)  # fmt: skip
def lift(state, dt, water, zones):
    """water lifts the bodies in it, and slows them"""
    bodies, nothing = state.bodies, zero_of(state)
    if not has_room(state, zones):
        return state.count
    zones.step = state.step_number
    for i in range(state.force_first, state.dynamic):
        zones.displaced[i], zones.rate[i], zones.flow[i] = 0.0, 0.0, nothing
        zones.torque[i, 0] = zones.torque[i, 1] = zones.torque[i, 2] = 0.0
    up, g = upwards(state)
    for j in range(begin_zones(state)):
        if not (water.present[j] and is_zone(state, j)):
            continue
        half, centre, height, reach = half_extents(state, bodies.shape[j], j), centre_of(state, j), 0.0, 0.0
        for k in range(len(half)):
            height, reach = height + item(centre, k) * up[k], reach + item(half, k) * abs(up[k])
        for i in range(state.force_first, state.dynamic):
            o = owner_of(state, i)
            if state.force_first <= o < state.dynamic and is_in(state, j, half, i):
                add_water(state, water, zones, i, Surface(j, half, up, height + reach, height - reach, g))
    for i in range(state.force_first, state.dynamic):
        if zones.displaced[i] > 0.0:
            force, by = bodies.force[i], g * zones.displaced[i] * bodies.gravity_scale[i]
            for k in range(len(force)):
                force = replace(force, k, item(force, k) + by * up[k])
            drawn = sub(zones.flow[i], scale(bodies.linear_velocity[i], zones.rate[i]))
            bodies.force[i] = scale(add_scaled(force, drawn, bodies.mass[i]), phi1(-zones.rate[i] * dt))
    return state.count


@acting.stage(
    after="keep_start", records=(Spin, ZONES), reads=("sleep_state", "quarantined"),
    writes=("spin.step_torque", "spin.angular_velocity"), needed="colliders",
)  # fmt: skip
def turn_in_water(state, dt, spin, zones):
    """water turns the bodies that float in it, and slows that"""
    bodies, plane = state.bodies, len(zero_of(state)) == 2
    wet = zones.step == state.step_number and has_room(state, zones)
    for i in range(state.first, state.dynamic if wet else 0):
        if not spin.present[i] or bodies.sleep_state[i] > 0 or bodies.quarantined[i] or zones.displaced[i] == 0.0:
            continue
        decay = exp(-zones.rate[i] * dt)
        for k in range(1 if plane else 3):
            spin.step_torque[i, k] += zones.torque[i, 2 if plane else k]
            spin.angular_velocity[i, k] *= decay
