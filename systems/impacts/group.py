"""What a group of impacts at the same time does to its bodies: all its impulses, found and given at once.

Newton's law holds for each of its impacts: they part at e times their approach, or faster if the others push them apart
(then its impulse is 0). With p the impulses and A what they do to the speeds along the normals, that is p >= 0,
A p >= (1 + e) approach, one of both equal: the velocities are unique, momentum is kept, and so is energy where e is 1.

The order of bodies is no matter, and mirrored groups stay mirrored, to the bit: each pass improves all impulses at
once, and sums do not depend on their order. It is a projected gradient with momentum (Y. Nesterov, 1983; restarted as
by B. O'Donoghue and E. Candes, 2015).
"""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, divided, dot, item, length, replace, scale, sub
from ..integration.trajectory import rate_along, relative_path
from ..integration.turning import compliance, is_turned, velocity_by_spin
from ..linking.parts import TURN_BY_IMPACT, call_turn_by_impact
from ..parts.rows import owner_of
from ..shapes.dispatch import friction_at
from ..shapes.surfaces import slip_at
from .impulses import count_impact, deflect, is_counted, is_immovable, log_impact, note_trapped, touch_of_event
from .turning import arms_of

PASSES, LEAST_PASSES = 1000, 8  # over the impacts of a group
WORK = 1 << 16  # impacts in all passes of a step: a heap of bodies that overlap is not worth more
GROUP_CONVERGED = 8e-16  # of the largest speed
SAME_ENERGY = 2e-15  # of a sum of energies
CANCELLED = 1e-6  # of what impulses would do if none worked against another: less is none
ORTHOGONAL = 1e-12  # cosine of the angle between normals that have nothing to do with each other
SHOT = 2.0  # times the fastest change of speed that its impacts ask for: a body that gains more is shot out
LAST_PLACE, HALF_PLACE = 2.0**-52, 2.0**-53


@part
def exact_sum(terms, count):
    """The sum of the first ``count`` terms, which does not depend on their order, and changes its sign with theirs; of
    two at most it is the plain one.

    Each term is cut into a part above a common last place, one above a lower one, and a rest that is left out, some
    2^-95 of the largest term if they are a few. The parts of all terms are multiples of one number and add up without
    rounding. (J. Demmel, H. D. Nguyen, "Fast reproducible floating-point summation", 2013.)
    """
    if count <= 2:
        return 0.0 if count == 0 else (terms[0] if count == 1 else terms[0] + terms[1])
    largest, several = 0.0, 4.0
    for k in range(count):
        largest = max(largest, abs(terms[k]))
    if largest == 0.0:
        return 0.0
    while several < count:
        several *= 2.0
    shifted = largest / HALF_PLACE
    power = abs((shifted + largest) - shifted)  # of two, the next above the largest (S. Rump)
    if power == 0.0:
        power = largest
    high = 3.0 * several * power  # adding it and taking it away again cuts a term at its last place
    low = high * several * LAST_PLACE
    total, rest = 0.0, 0.0
    for k in range(count):
        cut = (terms[k] + high) - high
        total += cut
        rest += ((terms[k] - cut) + low) - low
    return total + rest


@part
def sum_pushes(state, i, rubs):
    """What the impulses ``ahead`` of its impacts add to body i's velocity; with those of ``friction_impulse``, if rubs.
    """
    impacts, terms, total = state.impacts, state.impacts.terms, zero_of(state)
    for k in range(len(total)):
        count, entry = 0, impacts.first_member[i]
        while entry >= 0:
            m = entry // 2
            push = item(impacts.event_normal[impacts.member[m]], k) * impacts.ahead[m]
            if rubs:
                push += item(impacts.friction_impulse[m], k)
            terms[count] = push if entry % 2 == 1 else -push
            count, entry = count + 1, impacts.next_member[entry]
        total = replace(total, k, exact_sum(terms, count))
    return scale(total, state.bodies.inverse_mass[i])


@part
def push_bodies(state, count, rubs):
    """Write into ``gained`` what the impulses of the group give each of its bodies."""
    impacts, pairs = state.impacts, state.pairs
    for g in range(count):
        m = impacts.group[g]
        c = impacts.event_pair[impacts.member[m]]
        for side in range(2):
            i = owner_of(state, pairs.a[c] if side == 0 else pairs.b[c])
            if impacts.first_member[i] == 2 * m + side:  # once each
                impacts.gained[i] = sum_pushes(state, i, rubs)


@part
def count_coupled(state, m, i):
    """Impacts of body i, member m among them, whose normals are not at right angles to that of m."""
    impacts, entry, count = state.impacts, state.impacts.first_member[i], 0
    normal = impacts.event_normal[impacts.member[m]]
    while entry >= 0:
        count += abs(dot(normal, impacts.event_normal[impacts.member[entry // 2]])) > ORTHOGONAL
        entry = impacts.next_member[entry]
    return count


@part
def gained_along(state, m):
    """The speed along member m's normal that its bodies have gained from each other."""
    impacts, pairs = state.impacts, state.pairs
    c = impacts.event_pair[impacts.member[m]]
    gained = sub(impacts.gained[owner_of(state, pairs.b[c])], impacts.gained[owner_of(state, pairs.a[c])])
    return dot(gained, impacts.event_normal[impacts.member[m]])


@part
def solve_group(state, count):
    """Find the impulses of a group's impacts, into ``ahead``; returns whether there are such."""
    impacts, pairs, inverse_mass = state.impacts, state.pairs, state.bodies.inverse_mass
    group, ahead, share = impacts.group, impacts.ahead, impacts.share
    for g in range(count):
        m = group[g]
        c = impacts.event_pair[impacts.member[m]]
        a, b = owner_of(state, pairs.a[c]), owner_of(state, pairs.b[c])
        heavy = inverse_mass[a] * count_coupled(state, m, a) + inverse_mass[b] * count_coupled(state, m, b)
        impacts.weight[m] = 1.0 / heavy
        share[m] = ahead[m] = 0.0
    inertia = 1.0
    for _ in range(min(PASSES, (WORK - impacts.group_visits) // count)):
        impacts.group_visits += count
        push_bodies(state, count, False)
        worst, largest, back = improve_impulses(state, count)
        if worst <= GROUP_CONVERGED * largest:
            break
        inertia = 1.0 if back else inertia
        following = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * inertia * inertia))
        for g in range(count):
            m = group[g]
            swing = 0.0 if back else (inertia - 1.0) / following
            ahead[m] = share[m] + swing * (share[m] - impacts.before[m])
        inertia = following
    for g in range(count):
        ahead[group[g]] = share[group[g]]
    return keep_energy(state, count)


@part
def improve_impulses(state, count):
    """A pass over all impacts of a group: (largest change, largest speed in it, whether the momentum leads back)."""
    impacts, terms, worst, largest = state.impacts, state.impacts.terms, 0.0, 0.0
    for g in range(count):
        m = impacts.group[g]
        wanted, weight, ahead = impacts.event_change[impacts.member[m]], impacts.weight[m], impacts.ahead[m]
        before, share = impacts.share[m], max(0.0, ahead + (wanted - gained_along(state, m)) * weight)
        worst, largest = max(worst, abs(share - ahead) / weight), max(largest, wanted, share / weight)
        terms[g] = (ahead - share) * (share - before) / weight
        impacts.before[m], impacts.share[m] = before, share
    return worst, largest, exact_sum(terms, count) > 0.0


@part
def keep_energy(state, count):
    """Scale the impulses so that the group as a whole obeys its law, which they do but for rounding where the passes
    were enough: then energy is right in any case. False if no impulses can: those of what is squeezed between two that
    cannot be moved cancel each other, however high they are."""
    impacts, terms, size = state.impacts, state.impacts.terms, 0.0
    group, ahead = impacts.group, impacts.ahead
    push_bodies(state, count, False)
    for g in range(count):
        m = group[g]
        size += ahead[m] * ahead[m] / impacts.weight[m]
    for g in range(count):
        m = group[g]
        terms[g] = ahead[m] * impacts.event_change[impacts.member[m]]
    wanted = exact_sum(terms, count)
    for g in range(count):
        terms[g] = ahead[group[g]] * gained_along(state, group[g])
    given = exact_sum(terms, count)
    if not given > CANCELLED * size and size > 0.0:
        return False
    if abs(wanted - given) > SAME_ENERGY * wanted:
        for g in range(count):
            ahead[group[g]] *= wanted / given
        push_bodies(state, count, False)
    return True


@part
def is_ejected(state, i):
    """Whether the group gives body i far more speed than any of its impacts asks for: it is pinched between others at a
    small angle, which in truth opens on the way."""
    impacts, fastest, entry = state.impacts, 0.0, state.impacts.first_member[i]
    while entry >= 0:
        fastest = max(fastest, impacts.event_change[impacts.member[entry // 2]])
        entry = impacts.next_member[entry]
    return length(impacts.gained[i]) > SHOT * fastest


@part
def is_shooting(state, count):
    """Whether a body of the group that has been solved is shot out."""
    impacts, pairs, any_shot = state.impacts, state.pairs, False
    for g in range(count):
        c = impacts.event_pair[impacts.member[impacts.group[g]]]
        for i in (owner_of(state, pairs.a[c]), owner_of(state, pairs.b[c])):
            any_shot |= is_ejected(state, i)
    return any_shot


@part
def is_turning_group(state, count):
    """Whether impulses along their normals turn a body of the group."""
    impacts, pairs, bodies, any_turned = state.impacts, state.pairs, state.bodies, False
    for g in range(count if state.spinning else 0):
        c = impacts.event_pair[impacts.member[impacts.group[g]]]
        any_turned |= is_turned(bodies, pairs.a[c]) or is_turned(bodies, pairs.b[c])
    return any_turned


@part
def solve_group_friction(state, count):
    """Find the impulses of friction, into ``friction_impulse``; returns whether there are any.

    Bodies are taken to be split among their impacts, so that these together never do more than stop what slides.
    """
    impacts, pairs, bodies, rubs = state.impacts, state.pairs, state.bodies, False
    inverse_mass, group, member = bodies.inverse_mass, impacts.group, impacts.member
    for g in range(count):
        m = group[g]
        c = impacts.event_pair[member[m]]
        a, b, normal = pairs.a[c], pairs.b[c], impacts.event_normal[member[m]]
        touch = touch_of_event(state, member[m])
        mu, impacts.friction_impulse[m] = friction_at(state, a, b, touch), zero_of(state)
        if mu > 0.0 and impacts.ahead[m] > 0.0:
            w = slip_at(state, a, b, rate_along(relative_path(state, a, b), impacts.now), touch)
            w = add(w, sub(impacts.gained[owner_of(state, b)], impacts.gained[owner_of(state, a)]))
            arms = normal, normal
            if state.spinning:
                arms = arms_of(state, member[m])
                w = add(w, velocity_by_spin(bodies, a, b, arms))
            sliding = add_scaled(w, normal, -dot(w, normal))
            fast, light = length(sliding), 0.0
            for side in range(2 if fast > 0.0 else 0):
                i, arm, turning = (a, arms[0], 0.0) if side == 0 else (b, arms[1], 0.0)
                entry = impacts.first_member[owner_of(state, i)]
                if state.spinning:
                    turning = compliance(bodies, i, arm, divided(sliding, fast))
                while entry >= 0:
                    light, entry = light + inverse_mass[i] + turning, impacts.next_member[entry]
            if fast > 0.0:
                impacts.friction_impulse[m] = scale(sliding, -min(1.0 / light, mu * impacts.ahead[m] / fast))
                rubs = True
    return rubs


@part
def push_group(state, count, dt):
    """Give the bodies of a group their impulses, all at once, and note these."""
    impacts, pairs, bodies = state.impacts, state.pairs, state.bodies
    inverse_mass, group, member, now = bodies.inverse_mass, impacts.group, impacts.member, impacts.now
    rubs = solve_group_friction(state, count)
    if rubs:
        push_bodies(state, count, True)
    for g in range(count if rubs and state.spinning else 0):
        m = group[g]
        event = member[m]
        call_turn_by_impact(state.links[TURN_BY_IMPACT], state, event, 0.0, impacts.friction_impulse[m], dt)
    for g in range(count):
        m = group[g]
        event, impulse = member[m], impacts.ahead[m]
        c = impacts.event_pair[event]
        for side in range(2):
            i = owner_of(state, pairs.a[c] if side == 0 else pairs.b[c])
            if impacts.first_member[i] == 2 * m + side:
                deflect(state, i, impacts.gained[i], now, dt)
            if inverse_mass[i] > 0.0 and impulse > 0.0:
                count_impact(state, i, is_counted(state, event))
        if impulse > 0.0:
            impacts.event_time[event] = now
            log_impact(state, event, impulse)
    for strikes_mover in range(2 if impacts.sweeps else 0):
        for g in range(count):
            c = impacts.event_pair[member[group[g]]]
            a, b = pairs.a[c], pairs.b[c]
            for i in (a, b):
                still = is_immovable(bodies, a + b - i)
                if inverse_mass[i] > 0.0 and still == (strikes_mover == 0):
                    note_trapped(state, i, still)
