"""Apply last step's contact impulses to the free-flight prediction.

Free flight lets a resting body fall by g dt: a ball that bounces on it would find no ground. So the impulses of the
last step act on the prediction, bounded by the change of velocity by forces, or by the closing speed that the game has
added: for a light body between heavy ones they are small differences of large numbers. Where no contact holds the body
after all, they are taken back.
"""

from __future__ import annotations

from ....framework.compilation import inlined, packed, part
from ....framework.schedule.stages import Rows
from ....framework.vectors import add, add_scaled, dot, length, scale, sub
from ...codes import OK
from ...joints.bodies import push_joined
from ...parts.rows import owner_of
from ...parts.stages import copy_prediction_to_parts
from ...records import CURVES, PREDICTED
from .warm_start import find_rows, scale_to, skip_before


@part
def mark_disabled(state):
    """``off`` for what is remembered of pairs whose contact a system has disabled, or of which a body is gone. Both
    lists are in canonical order."""
    memory, pairs, entity = state.warm_start, state.pairs, state.bodies.entity
    now, m = memory.now, 0
    for k in range(memory.counts[now]):
        memory.off[k] = memory.first[now, k] < 0 or memory.second[now, k] < 0
    for c in range(pairs.count if pairs.disabled_count > 0 else 0):
        if not pairs.disabled[c]:
            continue
        a, b = entity[pairs.a[c]], entity[pairs.b[c]]
        m = skip_before(memory, m, a, b)
        while m < memory.counts[now] and memory.entity_a[now, m] == a and memory.entity_b[now, m] == b:
            memory.off[m] = True
            m += 1


@inlined
def note_closing(bodies, i, moving, push, closing, share):
    """``to_hold`` of body i becomes a share of a push where that closes faster than all before it."""
    to_hold = bodies.to_hold
    if i < moving and closing * abs(closing) > dot(to_hold[i], to_hold[i]):
        to_hold[i] = scale(push, share)


@part
def find_closing(state):
    """``to_hold``: how much faster than when the last step ended each body closes on what pushed it, along the push of
    the remembered contact where that is most, m/s; what forces have given it where that is more."""
    memory, bodies, now = state.warm_start, state.bodies, state.warm_start.now
    velocity = bodies.linear_velocity
    for i in range(state.first, state.moving):
        bodies.warm_start_velocity[i] = velocity[i]  # of all, so that no branch asks which are supported
        bodies.to_hold[i] = sub(velocity[i], bodies.start_velocity[i])
    for m in range(memory.counts[now]):
        if not memory.off[m]:
            a, b = owner_of(state, memory.first[now, m]), owner_of(state, memory.second[now, m])
            push = memory.push[now, m]
            size = length(push)
            closing = dot(push, sub(velocity[a], velocity[b])) / size - memory.closing[now, m]
            note_closing(bodies, a, state.moving, push, closing, -closing / size)
            note_closing(bodies, b, state.moving, push, closing, closing / size)


@part
def apply_remembered(state):
    """The impulses of the last step act on the velocities, with their friction."""
    memory, bodies, now = state.warm_start, state.bodies, state.warm_start.now
    velocity, inverse_mass = bodies.linear_velocity, bodies.inverse_mass
    for m in range(memory.counts[now]):
        if not memory.off[m]:
            a, b = owner_of(state, memory.first[now, m]), owner_of(state, memory.second[now, m])
            push = memory.push[now, m]
            w_a, w_b = inverse_mass[a], inverse_mass[b]
            if w_a > 0.0:  # storing what stays as it is would make contacts with one floor wait for each other
                bodies.warm_started[a], velocity[a] = True, add_scaled(velocity[a], push, -w_a)
            if w_b > 0.0:
                bodies.warm_started[b], velocity[b] = True, add_scaled(velocity[b], push, w_b)


@part
def forget_support(state):
    """Nothing is supported yet; what cannot move never is, but other rows may have been there."""
    warm_started = state.bodies.warm_started
    if len(warm_started) > 0:
        known = state.support_version == state.version
        for i in range(state.first if known else 0, state.moving if known else state.count):
            warm_started[i] = False
        state.support_version = state.version


@part
def may_support(state):
    """Whether something was held in the last step, or is held by joints."""
    memory = state.warm_start
    return not state.response_idle and (memory.counts[memory.now] > 0 or state.solver.joints.active > 0)


ROOM_FOR_SUPPORT = (
    Rows("bodies", PREDICTED, lambda s: s.count if may_support(s) else 0),
    Rows("bodies", CURVES, lambda s: s.count if may_support(s) and s.path_degree > 1 else 0),
)  # fmt: skip


@packed
def predict_rest(state, dt):
    """Correct velocity, position and path of the bodies that were held in the last step.

    The impulses act like a force throughout the step, which displaces by ``force_travels`` times dt times the change of
    velocity: what the integrator makes of a force.
    """
    bodies = state.bodies
    state.any_warm_started = False
    forget_support(state)
    if not may_support(state):
        return OK
    scale_to(state, dt)
    find_rows(state)
    state.any_warm_started = True
    state.force_travels = 0.5 if state.path_degree > 1 else (0.0 if state.moves_with_old_velocity else 1.0)
    mark_disabled(state)
    find_closing(state)
    apply_remembered(state)
    push_joined(state, dt)
    travels = state.force_travels
    for i in range(state.first, state.moving):
        if bodies.warm_started[i]:
            before = bodies.warm_start_velocity[i]
            dv = sub(bodies.linear_velocity[i], before)
            given, forced = length(dv), length(sub(before, bodies.start_velocity[i]))
            most = max(forced, dot(dv, bodies.to_hold[i]) / given if given > 0.0 else 0.0)
            if given > most:
                dv = scale(dv, most / given)
                bodies.linear_velocity[i] = add(before, dv)
            bodies.warm_start_velocity[i] = dv
            bodies.position[i] = add_scaled(bodies.position[i], dv, travels * dt)
            if state.path_degree > 1:
                bodies.path_second[i] = add_scaled(bodies.path_second[i], dv, travels / dt)
            else:
                bodies.path_velocity[i] = add_scaled(bodies.path_velocity[i], dv, travels)
    copy_prediction_to_parts(state)
    return OK


@part
def drop_support(state, dt):
    """Bodies that no contact has pushed after all fly as the integrator said. What has had an impact stays on the path
    that this has given it: beside it there may be a wall."""
    bodies, travels = state.bodies, state.force_travels
    for i in range(state.first, state.moving):
        if bodies.warm_started[i] and not bodies.held[i]:
            dv = bodies.warm_start_velocity[i]
            if bodies.impact_count[i] == 0:
                bodies.position[i] = add_scaled(bodies.position[i], dv, -travels * dt)
            bodies.linear_velocity[i] = sub(bodies.linear_velocity[i], dv)
