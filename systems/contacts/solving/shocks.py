"""Shocks: what closes fast is stopped before anything is pushed apart, and what that sends into others.

What one pass leaves undone of a blow would become overlap, and the push against that a bounce. So a blow travels
through all that touches: a contact is asked again whenever one of its bodies has been changed by more than a small part
of the blow that it comes from. Contacts far away are never asked, and a blow that has spread thin ends.

The impulses of a blow are not those of contacts at rest: they count in the step, but are not where the solver starts
in the next substep.
"""

from __future__ import annotations

import math

import numpy as np

from ....framework.compilation import part
from ....framework.vectors import add_scaled, dot, scale, sub
from ...bits import lowest_bit
from ..colours import COLOURS

SHOCK = 0.01  # of the extent, per step: a contact that closes faster is a shock
SETTLED = 0.015  # of the speed of the shock: corrections below it are left to the other passes
MOST_PASSES, FEWEST_PASSES = 256, 16  # over few contacts and over many, each time that there are shocks
WORK = 20_000  # times that contacts may be solved, if those passes are not the fewest
STRIDE = 4  # contacts of a body that are asked together: fewer branches to foresee
SHARE = 8  # of a contact in the lists: two bodies, each filled up by less than STRIDE
WORD, IN_WORD = 6, 63  # contact k is asked if bit k & IN_WORD of asked[k >> WORD] is set


@part
def link_contacts(solver):
    """Of each body that can be moved the list of its contacts, filled up to a multiple of STRIDE with the last one."""
    until, listed, inverse_mass, total = solver.contacts_until, solver.contact_of, solver.inverse_mass, 0
    for q in range(solver.bodies):
        until[q] = 0
    for k in range(solver.contacts):
        until[solver.first[k]] += 1
        until[solver.second[k]] += 1
    for q in range(solver.bodies):  # where its list begins, which grows until the next one begins
        room = (until[q] + STRIDE - 1) // STRIDE * STRIDE if inverse_mass[q] > 0.0 else 0
        total, until[q] = total + room, total
    for k in range(solver.contacts):
        for side in range(2):
            q = solver.first[k] if side == 0 else solver.second[k]
            if inverse_mass[q] > 0.0:
                listed[until[q] // SHARE, until[q] % SHARE] = k
                until[q] += 1
    for q in range(solver.bodies):
        while until[q] % STRIDE != 0:
            last = until[q] - 1
            listed[until[q] // SHARE, until[q] % SHARE] = listed[last // SHARE, last % SHARE]
            until[q] += 1
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
            solver.asked[k >> WORD] |= np.int64(1) << (k & IN_WORD)
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
        solver.blow[k] = 0.0
        if solver.has_friction:
            solver.blow_tangent[k] = scale(solver.normal[k], 0.0)
    for word in range((solver.contacts >> WORD) + 1):
        solver.asked[word] = 0
    for q in range(solver.bodies):
        solver.reach[q] = 0.0


@part
def stop_contact(solver, k):
    """Give a contact the impulse that stops it; returns the change of its impulse."""
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
    return abs(new - old)


@part
def ask_contacts_of(solver, q):
    """Ask the contacts of body q."""
    until, listed, asked = solver.contacts_until, solver.contact_of, solver.asked
    for begin in range(until[q - 1] if q > 0 else 0, until[q], STRIDE):
        for e in range(begin, begin + STRIDE):
            k = listed[e // SHARE, e % SHARE]
            asked[k >> WORD] |= np.int64(1) << (k & IN_WORD)


@part
def stop_batch(solver, word, bits):
    """Stop these contacts of a word; those come first in ``batch`` that have changed much. Returns (how many, of how
    many)."""
    inverse_mass, reach, batch, count, many = solver.inverse_mass, solver.reach, solver.batch, 0, 0
    while bits != 0:
        at = lowest_bit(bits)
        batch[count] = (word << WORD) + at
        bits &= ~(np.int64(1) << at)
        count += 1
    for e in range(count):  # no branch waits for what comes out
        solver.change[e] = stop_contact(solver, batch[e])
    for e in range(count):
        k = batch[e]
        a, b = solver.first[k], solver.second[k]
        speed = max(reach[a] if inverse_mass[a] > 0.0 else 0.0, reach[b] if inverse_mass[b] > 0.0 else 0.0)
        batch[many], solver.speed[many] = k, speed
        many += solver.change[e] > SETTLED * speed * solver.mass[k]
    return many, count


@part
def pass_on(solver, many):
    """Ask the other contacts of the bodies of the first contacts of ``batch``."""
    inverse_mass, reach = solver.inverse_mass, solver.reach
    for e in range(many):
        k, speed = solver.batch[e], solver.speed[e]
        for side in range(2):
            q = solver.first[k] if side == 0 else solver.second[k]
            if inverse_mass[q] > 0.0:
                reach[q] = speed
                ask_contacts_of(solver, q)


@part
def stop_asked(solver, start, stop, alone):
    """Stop the contacts from start to stop - 1 that are asked; returns how many. They share no body that moves: each
    but its own asks none of them. Else each is for itself (alone)."""
    asked, visits = solver.asked, 0
    for word in range(start >> WORD, ((stop - 1) >> WORD) + 1):
        begin, end = max(start - (word << WORD), 0), stop - (word << WORD)
        rest = np.int64(-1) << begin
        if end <= IN_WORD:
            rest &= ~(np.int64(-1) << end)
        while asked[word] & rest != 0:
            bits = asked[word] & rest
            if alone:
                bits = np.int64(1) << lowest_bit(bits)
            many, count = stop_batch(solver, word, bits)
            pass_on(solver, many)
            asked[word] &= ~bits
            rest = rest & ((np.int64(-1) << lowest_bit(bits)) << 1) if alone else np.int64(0)
            visits += count
    return visits


@part
def solve_shocks(solver, dt):
    """Stop what closes fast, and what that sends into others."""
    if not detect_shocks(solver, dt):
        return
    visits = 0
    for turn in range(MOST_PASSES):
        if turn >= FEWEST_PASSES and visits > WORK:
            break
        before, start = visits, 0
        for colour in range(COLOURS):
            stop = solver.starts[colour]  # by now, where the next one begins
            if start < stop:
                visits += stop_asked(solver, start, stop, colour == COLOURS - 1)
            start = stop
            if start == solver.contacts:
                break
        if visits == before:
            break
    solver.shock_visits += visits
    for k in range(solver.contacts):
        solver.shock[k] += solver.blow[k]
        solver.worked[k] |= solver.blow[k] > 0.0
