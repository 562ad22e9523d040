"""The stages: characters move last in the step, and act on others by forces in the next one."""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.vectors import add, add_scaled, dot, item, scale
from .casts import is_dynamic
from .records import MOST_HITS, ROWS
from .slides import cross
from .step import move_one, row_of, row_of_floor, up_of


@part
def limit_pushes(state, character, work):
    """What characters push gets no faster than the fastest of them wants to be."""
    bodies = state.bodies
    for k in range(work.pushes):
        j = work.pushed[k]
        gained, most = work.push[j], work.most_push[j]
        work.push[j], work.most_push[j] = scale(gained, 0.0), 0.0
        size = math.sqrt(dot(gained, gained))
        if size == 0.0:
            continue
        if character.present[j]:
            more = min(size, most - dot(character.velocity[j], gained) / size)
            character.pushed[j] = scale(gained, max(0.0, more) / size)
        else:
            excess = min(size, dot(bodies.linear_velocity[j], gained) / size - most)
            bodies.linear_velocity[j] = add_scaled(bodies.linear_velocity[j], gained, 0.0 - max(0.0, excess) / size)


def move_characters(state, dt, character, near, work, ladder):
    """Characters walk, jump, climb and are carried"""
    count, bodies = 0, state.bodies
    for i in range(state.dynamic, state.moving):
        count += character.present[i]
    rows = max(ROWS, state.count, 2 * MOST_HITS * count)
    if len(work.event) < rows or len(near.row) < rows:
        return rows
    work.events = work.pushes = 0
    for i in range(state.dynamic, state.moving):
        if character.present[i] and bodies.shape[i] >= 0:
            move_one(state, near, character, ladder, work, i, dt)
    for i in range(state.dynamic, state.moving):
        if character.present[i] and bodies.shape[i] >= 0:
            bodies.position[i], character.velocity[i] = work.place[i], work.velocity[i]
            character.place[i] = work.place[i]
            character.pushed[i] = scale(work.place[i], 0.0)
    limit_pushes(state, character, work)
    return rows


def press_bodies(state, dt, character):
    """Characters push what they have walked against, and press on what they stand on"""
    bodies = state.bodies
    for i in range(state.dynamic, state.moving):
        if character.present[i]:
            j = row_of(state, character.push_entity[i], character.push_row[i])
            if j >= 0 and is_dynamic(state, j):
                bodies.force[j] = add(bodies.force[j], character.push[i])
            j = row_of_floor(state, character, i)
            if j >= 0 and is_dynamic(state, j) and character.weight[i] > 0.0:
                bodies.force[j] = add_scaled(bodies.force[j], up_of(state, character, i), 0.0 - character.weight[i])


def tilt_bodies(state, dt, character, spin):
    """Bodies turn under the weight of characters"""
    for i in range(state.dynamic, state.moving):
        j = row_of_floor(state, character, i) if character.present[i] and character.weight[i] > 0.0 else -1
        if j >= 0 and is_dynamic(state, j) and spin.present[j]:
            arm, force = character.floor_arm[i], scale(up_of(state, character, i), 0.0 - character.weight[i])
            if len(arm) == 2:
                spin.step_torque[j, 0] += item(arm, 0) * item(force, 1) - item(arm, 1) * item(force, 0)
            else:
                torque = cross(arm, force)
                for k in range(3):
                    spin.step_torque[j, k] += item(torque, k)
