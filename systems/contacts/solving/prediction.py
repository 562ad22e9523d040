"""Apply what contacts and joints gave a body in the last step to the free-flight prediction.

Free flight lets a resting body fall by g dt: a ball that bounces on it would find no ground. So what held it acts on
the prediction once more, bounded by the change of velocity by forces, or by what the game has added against it since
the last step's end: a blow is not repeated. Where nothing holds the body after all, it is taken back.
"""

from __future__ import annotations

from ....framework.compilation import packed, part
from ....framework.schedule.stages import Rows
from ....framework.vectors import add, add_scaled, dot, length, scale, sub
from ...codes import OK
from ...linking.parts import JOINED_SUPPORT, call_of_step
from ...narrow_phase.manifolds import is_of_pair, skip_before
from ...parts.rows import owner_of
from ...parts.stages import copy_prediction_to_parts
from ...records import CURVES, PREDICTED
from .warm_start import FOLLOWS, find_rows, scale_to


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
        while is_of_pair(memory, m, a, b):
            memory.off[m] = True
            m += 1


@part
def mark_supported(state, dt):
    """``warm_started`` of the bodies that contacts or joints have held and still do."""
    memory, now = state.warm_start, state.warm_start.now
    inverse_mass, warm_started = state.bodies.inverse_mass, state.bodies.warm_started
    for m in range(memory.counts[now]):
        if not memory.off[m]:
            for i in (owner_of(state, memory.first[now, m]), owner_of(state, memory.second[now, m])):
                if inverse_mass[i] > 0.0:
                    warm_started[i] = True
    if state.solver.joints.active > 0:
        call_of_step(state.links[JOINED_SUPPORT], state, dt)


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


@part
def lead_of_hold(state, i):
    """By how much faster body i moves in the substeps of the solver, each with the velocity of its end, than the
    integrator moves it, which lets a change of velocity by forces act for the share ``force_travels`` of the step."""
    bodies, travels = state.bodies, state.force_travels
    change = sub(bodies.linear_velocity[i], bodies.start_velocity[i])
    lead = scale(change, 0.5 + 0.5 / state.substeps - travels)
    return add_scaled(lead, bodies.warm_start_velocity[i], travels)


@packed
def predict_rest(state, dt):
    """Correct velocity, position and path of the bodies that were held in the last step.

    What held them acts like a force throughout the step, and they move as the solver is to move them.
    """
    bodies, memory = state.bodies, state.warm_start
    state.any_warm_started = False
    state.solver.joints.period = max(dt, memory.period[memory.now] - FOLLOWS * dt) / state.substeps
    forget_support(state)
    if not may_support(state):
        return OK
    find_rows(state)
    scale_to(state, dt)
    state.any_warm_started = True
    state.force_travels = 0.5 if state.path_degree > 1 else (0.0 if state.moves_with_old_velocity else 1.0)
    mark_disabled(state)
    mark_supported(state, dt)
    travels = state.force_travels
    for i in range(state.first, state.moving):
        if bodies.warm_started[i]:
            flown, dv = bodies.linear_velocity[i], scale(bodies.hold[i], dt)
            given, forced = length(dv), length(sub(flown, bodies.start_velocity[i]))
            most = max(forced, dot(dv, sub(bodies.held_velocity[i], flown)) / given if given > 0.0 else 0.0)
            if given > most:
                dv = scale(dv, most / given)
            bodies.linear_velocity[i] = add(flown, dv)
            bodies.warm_start_velocity[i] = dv
            lead = lead_of_hold(state, i)
            bodies.position[i] = add_scaled(bodies.position[i], lead, dt)
            if state.path_degree > 1:
                lead = add_scaled(lead, dv, -travels)
                bodies.path_second[i] = add_scaled(bodies.path_second[i], dv, travels / dt)
            bodies.path_velocity[i] = add(bodies.path_velocity[i], lead)
    copy_prediction_to_parts(state)
    return OK


@part
def drop_support(state, dt):
    """Bodies that no contact has pushed after all fly as the integrator said. What has had an impact stays on the path
    that this has given it: beside it there may be a wall."""
    bodies = state.bodies
    for i in range(state.first, state.moving):
        if bodies.warm_started[i] and not bodies.held[i]:
            if bodies.impact_count[i] == 0:
                bodies.position[i] = add_scaled(bodies.position[i], lead_of_hold(state, i), -dt)
            bodies.linear_velocity[i] = sub(bodies.linear_velocity[i], bodies.warm_start_velocity[i])
