"""Shocks: what closes fast is stopped before anything is pushed apart, and what that sends into others.

What one pass leaves undone of a blow would become overlap, and the push against that a bounce. So a blow travels
through all that touches: a contact is asked again whenever one of its bodies has been changed by more than a small part
of the blow that it comes from. Contacts far away are never asked, and a blow that has spread thin ends.

The impulses of a blow are not those of contacts at rest: they count in the step, but are not where the solver starts
in the next substep.
"""

from __future__ import annotations

import math

from ....framework.compilation import part
from ....framework.vectors import add_scaled, dot, scale, sub

SHOCK = 0.01  # of the extent, per step: a contact that closes faster is a shock
SETTLED = 0.015  # of the speed of the shock: corrections below it are left to the other passes
MOST_PASSES, FEWEST_PASSES = 256, 16  # over few contacts and over many, each time that there are shocks
WORK = 20_000  # times that contacts may be solved, if those passes are not the fewest
RUN = 6  # contacts are looked through by 2**RUN


@part
def link_contacts(solver):
    """Of each body the list of its contacts: from newest[q] over link[k, side], as 2 k + side; -1 ends it."""
    newest, link, inverse_mass = solver.newest, solver.link, solver.inverse_mass
    for q in range(solver.bodies):
        newest[q] = -1
    for k in range(solver.contacts):
        for side in range(2):
            q = solver.first[k] if side == 0 else solver.second[k]
            if inverse_mass[q] > 0.0:
                link[k, side] = newest[q]
                newest[q] = 2 * k + side
    solver.linked = True


@part
def excess_speed(solver, k):
    """How much faster contact k closes than what is open lets it."""
    velocity = solver.velocity
    return dot(sub(velocity[solver.first[k]], velocity[solver.second[k]]), solver.normal[k]) - solver.opening[k]


@part
def closes_fast(solver, k, dt):
    """Whether contact k is a shock."""
    return excess_speed(solver, k) * dt > SHOCK * solver.extent[k]


@part
def detect_shocks(solver, dt):
    """Ask the contacts that close fast, more than what is open lets them; returns whether there are any."""
    inverse_mass, found = solver.inverse_mass, False
    for k in range(solver.contacts):
        if closes_fast(solver, k, dt):
            if not found:
                found = True
                begin_shocks(solver)
            solver.asked[k] = solver.busy[k >> RUN] = True
            for side in range(2):
                q = solver.first[k] if side == 0 else solver.second[k]
                if inverse_mass[q] > 0.0:
                    solver.reach[q] = max(solver.reach[q], excess_speed(solver, k))
    return found


@part
def begin_shocks(solver):
    """Nothing is asked yet."""
    if not solver.linked:
        link_contacts(solver)
    for k in range(solver.contacts):
        solver.asked[k], solver.blow[k] = False, 0.0
        if solver.has_friction:
            solver.blow_tangent[k] = scale(solver.normal[k], 0.0)
    for k in range((solver.contacts >> RUN) + 1):
        solver.busy[k] = False
    for q in range(solver.bodies):
        solver.reach[q] = 0.0


@part
def stop_contact(solver, k):
    """Give a contact the impulse that stops it; returns the change of its speed."""
    velocity, inverse_mass, n = solver.velocity, solver.inverse_mass, solver.normal[k]
    a, b, old = solver.first[k], solver.second[k], solver.blow[k]
    v_a, v_b = velocity[a], velocity[b]
    w_a, w_b, mass = inverse_mass[a], inverse_mass[b], solver.mass[k]
    new = max(0.0, old - mass * (dot(sub(v_b, v_a), n) + solver.opening[k]))
    solver.blow[k] = new
    v_a, v_b = add_scaled(v_a, n, (old - new) * w_a), add_scaled(v_b, n, (new - old) * w_b)
    if solver.friction[k] != 0.0:
        w, before = sub(v_b, v_a), solver.blow_tangent[k]
        pull = add_scaled(before, add_scaled(w, n, -dot(w, n)), -mass)
        strength, limit = math.sqrt(dot(pull, pull)), solver.friction[k] * new
        if strength > limit:
            pull = scale(pull, limit / strength)
        solver.blow_tangent[k] = pull
        change = sub(pull, before)
        v_a, v_b = add_scaled(v_a, change, -w_a), add_scaled(v_b, change, w_b)
    velocity[a], velocity[b] = v_a, v_b
    return abs(new - old) / mass


@part
def ask_contacts_of(solver, q, without):
    """Ask the contacts of body q, without one of them."""
    e = solver.newest[q]
    while e >= 0:
        k = e >> 1
        if k != without:
            solver.asked[k] = solver.busy[k >> RUN] = True
        e = solver.link[k, e & 1]


@part
def pass_on(solver, k, change):
    """Ask the contacts of both bodies of contact k, if it has changed them by much."""
    a, b, inverse_mass, reach = solver.first[k], solver.second[k], solver.inverse_mass, solver.reach
    of_a, of_b = inverse_mass[a] > 0.0, inverse_mass[b] > 0.0
    speed = max(reach[a] if of_a else 0.0, reach[b] if of_b else 0.0)
    if change <= SETTLED * speed:
        return
    if of_a:
        reach[a] = speed
        ask_contacts_of(solver, a, k)
    if of_b:
        reach[b] = speed
        ask_contacts_of(solver, b, k)


@part
def solve_shocks(solver, dt):
    """Stop what closes fast, and what that sends into others."""
    if not detect_shocks(solver, dt):
        return
    asked, busy = solver.asked, solver.busy
    runs = (solver.contacts >> RUN) + 1
    visits = 0
    for turn in range(MOST_PASSES):
        if turn >= FEWEST_PASSES and visits > WORK:
            break
        any_asked = False
        for run in range(runs):
            if not busy[run]:
                continue
            any_asked, busy[run] = True, False
            for k in range(run << RUN, min(solver.contacts, (run + 1) << RUN)):
                if asked[k]:
                    asked[k] = False
                    visits += 1
                    pass_on(solver, k, stop_contact(solver, k))
        if not any_asked:
            break
    solver.shock_visits += visits
    for k in range(solver.contacts):
        solver.shock[k] += solver.blow[k]
        solver.worked[k] |= solver.blow[k] > 0.0
