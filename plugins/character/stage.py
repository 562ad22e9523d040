"""The stage that moves all characters, and what they do to others once all have been moved."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.vectors import add, add_scaled, dot, item, replace, scale
from .casts import is_dynamic
from .records import FLOOR, MOST_HITS, ROWS
from .slides import cross
from .walk import move_one, row_of_floor, up_of


@inlined
def wake(state, work, j):
    """Let Python wake row j, if it sleeps; returns whether it does."""
    asleep = j < state.sleepers
    if asleep:
        work.woken[work.wakes] = state.bodies.entity[j]
        work.wakes += 1
    return asleep


@part
def apply_pushes(state, character, work):
    """What characters have pushed gets faster, none faster than the fastest of them wants to be."""
    bodies = state.bodies
    for k in range(work.pushes):
        j = work.pushed[k]
        change, most = work.push[j], work.most_push[j]
        work.push[j], work.most_push[j] = scale(change, 0.0), 0.0
        velocity = character.velocity[j] if character.present[j] else bodies.linear_velocity[j]
        size = math.sqrt(dot(change, change))
        if size == 0.0 or (not character.present[j] and wake(state, work, j)):
            continue
        change = scale(change, max(0.0, min(size, most - dot(velocity, change) / size)) / size)
        if character.present[j]:
            character.pushed[j] = change
        else:
            bodies.linear_velocity[j] = add(velocity, change)


@part
def turn_by(state, spin, j, torque):
    """Change the angular velocity of row j by an impulse of torque; in a plane its first component."""
    inertia, products = state.bodies.inverse_inertia[j], state.bodies.inverse_products[j]
    if len(torque) == 2:
        spin.angular_velocity[j, 0] += inertia[0] * torque[0]
        return
    x, y, z = item(torque, 0), item(torque, 1), item(torque, 2)
    xy, xz, yz = item(products, 0), item(products, 1), item(products, 2)
    spin.angular_velocity[j, 0] += item(inertia, 0) * x + xy * y + xz * z
    spin.angular_velocity[j, 1] += xy * x + item(inertia, 1) * y + yz * z
    spin.angular_velocity[j, 2] += xz * x + yz * y + item(inertia, 2) * z


@part
def press(state, character, spin, work, i, dt):
    """Its weight acts on a dynamic floor, below its feet."""
    bodies, up, foot = state.bodies, up_of(state, character, i), 0.0
    j = row_of_floor(state, character, i)
    if j < 0 or not is_dynamic(state, j) or wake(state, work, j):
        return
    for k in range(len(up)):
        foot += abs(item(up, k)) * item(bodies.half_extents[i], k)
    impulse = scale(up, 0.0 - character.weight[i] * dt)
    bodies.linear_velocity[j] = add_scaled(bodies.linear_velocity[j], impulse, bodies.inverse_mass[j])
    if len(spin.present) > 0 and spin.present[j] and len(bodies.inverse_inertia) > 0:
        at = add_scaled(add(bodies.position[i], bodies.offset[i]), up, 0.0 - foot)
        arm = add_scaled(at, bodies.position[j], -1.0)
        torque = cross(arm, impulse)
        if len(arm) == 2:
            torque = replace(torque, 0, item(arm, 0) * item(impulse, 1) - item(arm, 1) * item(impulse, 0))
        turn_by(state, spin, j, torque)


def move_characters(state, dt, character, near, work, ladder, spin):
    """Characters walk, jump, climb and are carried"""
    count, bodies = 0, state.bodies
    for i in range(state.dynamic, state.moving):
        count += character.present[i]
    rows = max(ROWS, state.count, 2 * MOST_HITS * count)
    if len(work.event) < rows or len(near.row) < rows:
        return rows
    work.events = work.pushes = work.wakes = 0
    for i in range(state.dynamic, state.moving):
        if character.present[i] and bodies.shape[i] >= 0:
            move_one(state, near, character, ladder, work, i, dt)
    for i in range(state.dynamic, state.moving):
        if character.present[i] and bodies.shape[i] >= 0:
            bodies.position[i], character.velocity[i] = work.place[i], work.velocity[i]
            character.pushed[i] = scale(work.place[i], 0.0)
            if character.weight[i] > 0.0 and character.state[i] == FLOOR:
                press(state, character, spin, work, i, dt)
    apply_pushes(state, character, work)
    work.statics_version = state.statics_version
    return rows
