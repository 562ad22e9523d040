"""What an impact does to its bodies: an impulse; where it is left to the solver, sliding or standing still.

A body's path within the step is x(t) = origin + p1 t + p2 t^2 + p3 t^3. An impact at time t changes the velocity by
dv; the path becomes the one of a body that has travelled with dv all along and stood at origin - dv t at the start, so
one polynomial always describes what is left of the step.
"""

from __future__ import annotations

from ...framework.compilation import inlined, part
from ...framework.elementary import exp
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, dot, length, scale, sub
from ..ccd.search_bounds import EVENT_DRIVEN, FAST
from ..ccd.turning_touch import STOPPED
from ..integration.trajectory import along, centre_at, path_of, rate_along
from ..joints.groups import is_joined
from ..linking.parts import JOINED_IMPACT, TURN_BY_IMPACT, call_turn_by_impact
from ..narrow_phase.manifolds import forget_manifold
from ..parts.rows import next_row, owner_of
from ..shapes.dispatch import restitution_at, restitution_of
from .turning import kinematic_normal_speed

# Events: an impact; a crossing of what does not push; a touch from which on the solver has the two; the time after
# which nothing is known of two that turn too far. Else: none.
IMPACT, CROSSING, HAND_OVER, HALT, NO_EVENT = range(5)
MOST_LOOKS = 16_000_000  # at pairs in a step, of elastic impacts too: some seconds, then what meets is stopped
FEW_IMPACTS, TRAPPED_IMPACTS = 16, 1000  # impacts of a body in a step, one after the other with what stands still


@part
def deflect(state, i, dv, now, dt):
    """Give a body its change of velocity, and the rest of the step with it.

    In an event-driven world damping acts at the end of the step, for half of it. Else it acts all the time; the
    velocity of a straight path is that of the start, of all damping to come, or that of the end already. What has been
    stopped stays where it is.
    """
    bodies, i = state.bodies, owner_of(state, i)
    velocity = bodies.linear_velocity
    acting = dt - now if state.path_degree > 1 else dt * state.moves_with_old_velocity
    if state.impacts.sweeps and state.mode == EVENT_DRIVEN:
        acting = 0.5 * dt
    fading = bodies.total_damping[i] * acting
    decay = exp(-fading) if fading > 0.0 else 1.0
    while i >= 0:
        if bodies.impact_count[i] >= STOPPED:
            velocity[i] = add(velocity[i], dv)
        else:
            bodies.start_velocity[i] = add(bodies.start_velocity[i], dv)
            bodies.origin[i] = add_scaled(bodies.origin[i], dv, -now)
            bodies.path_velocity[i] = add(bodies.path_velocity[i], dv)
            bodies.position[i] = add_scaled(bodies.position[i], dv, dt - now)
            velocity[i] = add_scaled(velocity[i], dv, decay)
        i = next_row(state, i)


@part
def count_impact(state, i, counted):
    """One more impact of body i; counted: by the cap, too."""
    bodies, i = state.bodies, owner_of(state, i)
    while i >= 0:
        bodies.impact_count[i] += 1
        bodies.counted_impacts[i] += counted
        i = next_row(state, i)


@part
def note_trapped(state, i, still):
    """One more impact of body i in a row with what stands still, or the end of these."""
    caught, i = state.bodies.trapped_impacts, owner_of(state, i)
    while i >= 0:
        caught[i] = caught[i] + 1 if still else 0
        i = next_row(state, i)


@part
def log_impact(state, event, impulse):
    """Note its pair, time, impulse, normal and point; also with the pair."""
    impacts, pairs = state.impacts, state.pairs
    logged, c, t = impacts.logged, impacts.event_pair[event], impacts.event_time[event]
    normal = impacts.event_normal[event]
    pairs.impulse[c] += impulse
    pairs.normal[c], pairs.struck[c] = normal, t
    forget_manifold(pairs, c)
    impacts.log_pair[logged], impacts.log_time[logged], impacts.log_impulse[logged] = c, t, impulse
    impacts.log_normal[logged], impacts.log_point[logged] = normal, impacts.event_point[event]
    impacts.logged += 1


@part
def note_crossing(state, event):
    """Two have met whose paths that does not change: note the pair, the point in the world, and the normal."""
    impacts, pairs, c = state.impacts, state.pairs, state.impacts.event_pair[event]
    pairs.crossed[c], pairs.point[c], pairs.normal[c] = True, impacts.event_point[event], impacts.event_normal[event]
    forget_manifold(pairs, c)


@inlined
def is_immovable(bodies, i):
    """Whether body i neither can be moved nor moves by itself."""
    return bodies.inverse_mass[i] == 0.0 and length(bodies.path_velocity[i]) == 0.0


@inlined
def touch_of_event(state, event):
    """(point from the centre of a's shape, normal, from that centre to that of b's shape) of an impact."""
    impacts, pairs = state.impacts, state.pairs
    c, t = impacts.event_pair[event], impacts.event_time[event]
    one, other = centre_at(state, pairs.a[c], t), centre_at(state, pairs.b[c], t)
    return sub(impacts.event_point[event], one), impacts.event_normal[event], sub(other, one)


@part
def is_counted(state, event):
    """Whether the cap counts an impact: in an event-driven world an elastic one only if something drives the bodies or
    no time has passed, so that it need not end."""
    impacts, bodies = state.impacts, state.bodies
    if not (impacts.sweeps and state.mode == EVENT_DRIVEN and impacts.event_kind[event] == IMPACT):
        return True
    c, t = impacts.event_pair[event], impacts.event_time[event]
    inverse_mass, last = bodies.inverse_mass, bodies.last_impact
    a, b = state.pairs.a[c], state.pairs.b[c]
    if restitution_at(state, a, b, touch_of_event(state, event)) != 1.0 or t <= last[a] or t <= last[b]:
        return True
    one = a if inverse_mass[a] == 0.0 else b
    return inverse_mass[one] == 0.0 and not is_immovable(bodies, one)


@part
def bounce_pair(state, event, dt):
    """One impact: both bodies get their impulse now, and the rest of the step with the new velocities."""
    impacts, pairs, bodies = state.impacts, state.pairs, state.bodies
    c = impacts.event_pair[event]
    a, b, now = pairs.a[c], pairs.b[c], impacts.event_time[event]
    inverse_mass = bodies.inverse_mass
    mass, counted = 1.0 / (inverse_mass[a] + inverse_mass[b]), is_counted(state, event)
    if state.spinning and is_joined(state, a, b):  # what joints answer may leave less of it
        impulse, friction = impacts.event_change[event] * mass, scale(impacts.event_pull[event], mass)
        call_turn_by_impact(state.links[JOINED_IMPACT], state, event, impulse, friction, dt)
    faster, pull = impacts.event_change[event], impacts.event_pull[event]
    change = add(scale(impacts.event_normal[event], faster), pull)  # of the bodies' relative velocity, by friction too
    if state.spinning:
        call_turn_by_impact(state.links[TURN_BY_IMPACT], state, event, faster * mass, scale(pull, mass), dt)
    for i, push in ((a, -mass), (b, mass)):
        if inverse_mass[i] > 0.0:  # what cannot be moved is as it was: its other impacts stand, and no cap is on it
            count_impact(state, i, counted)
            if impacts.sweeps:
                note_trapped(state, i, is_immovable(bodies, a + b - i))
            deflect(state, i, scale(change, push * inverse_mass[i]), now, dt)
    log_impact(state, event, faster * mass)


@part
def is_deflected(state, i):
    """Whether impacts have changed a body's path so much that it seems to come from far off its start.

    The solver for contacts at rest moves bodies from there, and knows their contacts where they are.
    """
    bodies = state.bodies
    return length(sub(bodies.origin[i], bodies.previous_position[i])) > FAST * bodies.min_extent[i]


@inlined
def trapped_limit(state):
    """The impacts of a body in a row with what stands still after which it is caught."""
    return TRAPPED_IMPACTS if state.mode == EVENT_DRIVEN else max(FEW_IMPACTS, min(TRAPPED_IMPACTS, state.max_impacts))


@part
def is_trapped(state, a, b):
    """Whether one of the two bounces for ever between things that stand still, of which the other is one."""
    bodies, caught, most = state.bodies, state.bodies.trapped_impacts, trapped_limit(state)
    return (caught[a] >= most and is_immovable(bodies, b)) or (caught[b] >= most and is_immovable(bodies, a))


@part
def is_beyond_cap(state, a, b):
    """Whether one of the two has had all the impacts it may have in a step."""
    counted, cap = state.bodies.counted_impacts, state.max_impacts
    if state.impacts.sweeps and is_trapped(state, a, b):
        return True
    return counted[a] >= cap or counted[b] >= cap or state.impacts.looked >= MOST_LOOKS


@part
def stop_body(state, i, now):
    """Beyond the cap a fast body stays where it is until the step ends, and keeps its velocity."""
    bodies, path, zero = state.bodies, path_of(state, i), zero_of(state)
    at, velocity, i = along(path, now), rate_along(path, now), owner_of(state, i)
    while i >= 0:
        bodies.linear_velocity[i], bodies.position[i] = velocity, at
        bodies.origin[i], bodies.path_velocity[i] = at, zero
        if state.path_degree > 1:
            bodies.path_second[i], bodies.path_third[i] = zero, zero
        bodies.impact_count[i] += STOPPED
        bodies.counted_impacts[i] += STOPPED
        i = next_row(state, i)


@part
def slide_body(state, i, normal, rate, dt):
    """A body that is caught in a slot little wider than itself keeps its velocity, but moves only along the slot until
    the step ends, or as what turns there carries it: its impacts in between would be too many to count, and end where
    they began. rate: m/s, of that along the normal."""
    bodies, now = state.bodies, state.impacts.now
    x0, x1, x2, x3 = path_of(state, i)
    old = x0, x1, x2, x3
    x1 = add_scaled(x1, normal, rate - dot(x1, normal))
    x2, x3 = add_scaled(x2, normal, -dot(x2, normal)), add_scaled(x3, normal, -dot(x3, normal))
    x0 = add(x0, sub(along(old, now), along((x0, x1, x2, x3), now)))
    at, i = add(bodies.position[i], sub(along((x0, x1, x2, x3), dt), along(old, dt))), owner_of(state, i)
    count_impact(state, i, False)
    while i >= 0:
        bodies.position[i], bodies.origin[i], bodies.path_velocity[i] = at, x0, x1
        if state.path_degree > 1:
            bodies.path_second[i], bodies.path_third[i] = x2, x3
        i = next_row(state, i)


@part
def count_capped(state, a, b):
    """An impact of two bodies is beyond the cap of one of them."""
    impacts, counts = state.impacts, state.bodies.impact_count
    if impacts.capped == 0:
        impacts.capped_row = a if counts[a] >= counts[b] else b
    impacts.capped += 1


@part
def hand_over(state, event, dt):
    """Leave a touch to the solver. What lands, too slow to bounce, loses its approach and slides along what cannot be
    moved, as does what is caught there, until it is caught twice as often; what else is beyond the cap, or halts, stays
    where it is."""
    impacts, pairs, bodies = state.impacts, state.pairs, state.bodies
    inverse_mass = bodies.inverse_mass
    c = impacts.event_pair[event]
    a, b = pairs.a[c], pairs.b[c]
    landing = impacts.event_kind[event] == HAND_OVER and not is_beyond_cap(state, a, b)
    halts = impacts.event_kind[event] == HALT
    if landing:
        bounce_pair(state, event, dt)
    elif not halts:
        count_capped(state, a, b)
    caught = not halts and restitution_of(state, a, b) == 1.0 and is_trapped(state, a, b)
    if landing or (caught and max(bodies.trapped_impacts[a], bodies.trapped_impacts[b]) < 2 * trapped_limit(state)):
        if inverse_mass[a] * inverse_mass[b] == 0.0:
            i = a if inverse_mass[a] > 0.0 else b
            rate = kinematic_normal_speed(state, event) if state.spinning else 0.0
            slide_body(state, i, impacts.event_normal[event], rate, dt)
            if not landing:  # what turns may touch again at once, whatever it slides along
                note_trapped(state, i, True)
        return
    note_crossing(state, event)
    for i in (a, b):
        if inverse_mass[i] > 0.0 and bodies.impact_count[i] < STOPPED:
            stop_body(state, i, impacts.now)
