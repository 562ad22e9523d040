"""What bodies at rest will do in this step, before anything is known about it: the contacts that held them still push.

Free flight lets a resting body fall by g dt. For a ball that bounces on such a body the ground would give way. So the
impulses of the last step act on the prediction once more; where they push bodies apart they are taken back, so that a
shock is not repeated, and they never pull.
"""

from __future__ import annotations

from ...framework.compilation import packed, part
from ...framework.vectors import add_scaled, dot, length, sub
from ..codes import NEED_COLUMNS, OK
from .solving.heavy_light_blocks import RATIO
from .solving.warm_start import find_rows, scale_to

UNEVEN_PASSES = 8
THROWN = 20.0  # times the change of speed that forces make in the step; more, and more than a pair closes with: a shock


@part
def mark_disabled(state):
    """work[m] = 0 for what is remembered of pairs whose contact a system has disabled, else 1. Both lists are in
    canonical order."""
    memory, pairs, entity = state.warm_start, state.pairs, state.bodies.entity
    now, m = memory.now, 0
    for k in range(memory.counts[now]):
        memory.work[k] = 1.0
    for q in range(pairs.disabled_count):
        c = pairs.disabled[q]
        a, b = entity[pairs.a[c]], entity[pairs.b[c]]
        while m < memory.counts[now] and (
            memory.entity_a[now, m] < a or (memory.entity_a[now, m] == a and memory.entity_b[now, m] < b)
        ):
            m += 1
        if m < memory.counts[now] and memory.entity_a[now, m] == a and memory.entity_b[now, m] == b:
            memory.work[m] = 0.0


@part
def apply_remembered(state):
    """The impulses of the last step act on the velocities; work[m] is what acts of each."""
    memory, bodies, now = state.warm_start, state.bodies, state.warm_start.now
    velocity, inverse_mass, impulse = bodies.linear_velocity, bodies.inverse_mass, memory.work
    for i in range(state.moving):
        bodies.support_change[i] = velocity[i]  # of all, so that no branch asks which are supported
    for m in range(memory.counts[now]):
        a, b, total = memory.first[now, m], memory.second[now, m], memory.total[now, m]
        if a < 0 or b < 0 or total <= 0.0 or impulse[m] == 0.0:
            impulse[m] = 0.0
            continue
        impulse[m] = total
        for side in range(2):
            i = a if side == 0 else b
            bodies.supported[i] = inverse_mass[i] > 0.0
        n = memory.normal[now, m]
        velocity[a] = add_scaled(velocity[a], n, -total * inverse_mass[a])
        velocity[b] = add_scaled(velocity[b], n, total * inverse_mass[b])


@part
def relax_remembered(state, uneven):
    """Take back what pushes two bodies apart, never more than has pushed; uneven: only of a light and a heavy body.

    Returns whether there are such.
    """
    memory, bodies, now = state.warm_start, state.bodies, state.warm_start.now
    velocity, inverse_mass, impulse, any_uneven = bodies.linear_velocity, bodies.inverse_mass, memory.work, False
    for m in range(memory.counts[now]):
        a, b, n = memory.first[now, m], memory.second[now, m], memory.normal[now, m]
        if not impulse[m] > 0.0:
            continue
        light, heavy = max(inverse_mass[a], inverse_mass[b]), min(inverse_mass[a], inverse_mass[b])
        is_uneven = heavy > 0.0 and light >= RATIO * heavy
        any_uneven |= is_uneven
        if uneven and not is_uneven:
            continue
        parting = dot(sub(velocity[b], velocity[a]), n)
        if parting > 0.0:
            back = min(impulse[m], parting / (inverse_mass[a] + inverse_mass[b]))
            impulse[m] -= back
            velocity[a] = add_scaled(velocity[a], n, back * inverse_mass[a])
            velocity[b] = add_scaled(velocity[b], n, -back * inverse_mass[b])
    return any_uneven


@part
def is_thrown(bodies, i, fastest):
    """Whether the remembered impulses change the velocity of body i by more than that."""
    if bodies.inverse_mass[i] == 0.0:
        return False
    dv = sub(bodies.linear_velocity[i], bodies.support_change[i])
    return dot(dv, dv) > fastest * fastest


@part
def speed_before(bodies, i):
    """The velocity of body i without the remembered impulses."""
    return bodies.support_change[i] if bodies.supported[i] else bodies.linear_velocity[i]


@part
def some_thrown(state):
    """Whether any body is, by what its own forces change."""
    bodies = state.bodies
    for i in range(state.moving):
        if bodies.supported[i] and is_thrown(bodies, i, THROWN * bodies.force_speed_change[i]):
            return True
    return False


@part
def drop_shocks(state):
    """Take back what was a shock: contacts at rest act against forces and against the little that bodies close with."""
    if not some_thrown(state):
        return False
    memory, bodies, now, any_thrown = state.warm_start, state.bodies, state.warm_start.now, False
    velocity, inverse_mass, impulse = bodies.linear_velocity, bodies.inverse_mass, memory.work
    for m in range(memory.counts[now]):
        if impulse[m] > 0.0:
            a, b, n = memory.first[now, m], memory.second[now, m], memory.normal[now, m]
            fastest = THROWN * max(bodies.force_speed_change[a], bodies.force_speed_change[b])
            if not (is_thrown(bodies, a, fastest) or is_thrown(bodies, b, fastest)):
                continue  # usual: the speed that they close with need not be known
            fastest += length(sub(speed_before(bodies, b), speed_before(bodies, a)))
            if is_thrown(bodies, a, fastest) or is_thrown(bodies, b, fastest):
                velocity[a] = add_scaled(velocity[a], n, impulse[m] * inverse_mass[a])
                velocity[b] = add_scaled(velocity[b], n, -impulse[m] * inverse_mass[b])
                impulse[m], any_thrown = 0.0, True
    return any_thrown


@part
def forget_support(state):
    """Nothing is supported yet; what cannot move never is, but other rows may have been there."""
    supported = state.bodies.supported
    if len(supported) > 0:
        for i in range(state.moving if state.support_version == state.version else state.count):
            supported[i] = False
        state.support_version = state.version


@packed
def predict_rest(state, dt):
    """Correct velocity, position and path of the bodies that were held in the last step.

    The impulses act like a force throughout the step, which displaces by ``force_travels`` times dt times the change of
    velocity: what the integrator makes of a force.
    """
    bodies, memory = state.bodies, state.warm_start
    state.any_support = False
    forget_support(state)
    if state.response_idle or memory.counts[memory.now] == 0:
        return OK
    if len(bodies.support_change) == 0:
        return NEED_COLUMNS
    scale_to(state, dt)
    find_rows(state)
    state.any_support = True
    state.force_travels = 0.5 if state.path_degree > 1 else (0.0 if state.moves_with_old_velocity else 1.0)
    mark_disabled(state)
    apply_remembered(state)
    any_uneven = relax_remembered(state, False)
    for _ in range(UNEVEN_PASSES if any_uneven else 0):  # one leaves the more the more the masses differ
        relax_remembered(state, True)
    for _ in range(UNEVEN_PASSES):
        if not drop_shocks(state):
            break
    travels = state.force_travels
    for i in range(state.moving):
        if bodies.supported[i]:
            dv = sub(bodies.linear_velocity[i], bodies.support_change[i])
            bodies.support_change[i] = dv
            bodies.position[i] = add_scaled(bodies.position[i], dv, travels * dt)
            if state.path_degree > 1:
                bodies.path_second[i] = add_scaled(bodies.path_second[i], dv, travels / dt)
            else:
                bodies.path_velocity[i] = add_scaled(bodies.path_velocity[i], dv, travels)
    return OK


@part
def drop_support(state, dt, stopped):
    """Bodies that no contact has pushed after all fly as the integrator said; those that were ``stopped``, by so many
    impacts, stay where they are."""
    bodies, travels = state.bodies, state.force_travels
    for i in range(state.moving):
        if bodies.supported[i] and not bodies.held[i]:
            dv = bodies.support_change[i]
            if bodies.impact_count[i] < stopped:
                bodies.position[i] = add_scaled(bodies.position[i], dv, -travels * dt)
            bodies.linear_velocity[i] = sub(bodies.linear_velocity[i], dv)
