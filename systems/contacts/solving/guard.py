"""What the usual passes of a substep leave undone: further passes, and a bound on the energy that rows give.

Contacts at rest take energy from their island. Impulses that were those of another moment may give some: passes go on
over the rows of such islands, and over rows that are not solved. What energy is left after these, but for a
bounded push, is taken back: of all that the contacts have changed only the share acts that takes the most.
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, part
from ....framework.vectors import add, add_scaled, dot, scale, sub
from ...integration.turning import momentum_of_spin
from ...joints import calls
from ...joints.calls import for_joints
from ..constants import (
    FINER_PASSES,
    FULL_PUSH_OVERLAP,
    GAIN_PUSH,
    GAIN_ROUNDING,
    GAIN_WEIGHT,
    ISLAND_WORK,
    STRUCK_EXCESS,
)  # fmt: skip
from .chunks import relax_pairs
from .passes import most_repeats
from .rows import excess_speed, relax_listed, velocity_at

NO_NUMBERS = 0.0, 0.0


@part
def island_of(solver, k):
    """The island of row k."""
    return max(solver.island[solver.first[k]], solver.island[solver.second[k]])


@part
def islands_of(solver, span):
    """The first island of a range and the one behind its last."""
    if span[2] == 0:
        return 0, solver.islands
    return solver.island[span[2]], solver.island[span[2]] + 1


@part
def list_open(solver, span, arms):
    """Islands with rows in ``listed`` are open: further passes go over their joints, and their energy is weighed."""
    opened = 0
    for q in range(span[2], span[3]):
        t = solver.island[q]
        solver.open_body[opened] = q
        opened += t >= 0 and solver.listed_of[t] > 0
    solver.opened = opened
    for_joints(solver, calls.OPEN, NO_NUMBERS, span, arms)


@part
def open_all(solver, listed, span, arms):
    """All islands of a range are open. listed: what is in them is so already."""
    islands = islands_of(solver, span)
    for t in range(islands[0], islands[1]):
        solver.listed_of[t] = 1
    if not listed:
        list_open(solver, span, arms)


@part
def work_of_row(solver, k, arms):
    """The work of a row on what moves by itself, or drives a surface, J: minus what that gives to the island."""
    a, b, island, work = solver.first[k], solver.second[k], solver.island, 0.0
    if min(island[a], island[b]) < 0:
        push = scale(solver.normal[k], solver.impulse[k])
        if solver.has_friction:
            push = add(push, solver.tangent[k])
        if island[b] < 0:
            work = dot(push, velocity_at(solver, b, solver.arm_b, k, arms))
        else:
            work = -dot(push, velocity_at(solver, a, solver.arm_a, k, arms))
    if solver.surfaces_run:
        work += dot(solver.tangent[k], solver.surface_slip[k])
    return work


@part
def add_work(solver, span, arms):
    """What moves by itself gives its work to open islands: it is no gain of contacts."""
    for k in range(span[0], span[1] if solver.movers > 0 or solver.surfaces_run else span[0]):
        t = island_of(solver, k)
        if solver.listed_of[t] > 0:
            solver.slope[t] += work_of_row(solver, k, arms)
    for_joints(solver, calls.ADD_WORK, NO_NUMBERS, span, arms)


@part
def measure_energy(solver, span, arms, islands):
    """What contacts do to the energy of each open island if a share s of all that they have changed acts: E(s) =
    slope s + curvature s^2 / 2, which is exact, and without the work that is done on the island."""
    slope, curvature, energy, island = solver.slope, solver.curvature, solver.energy, solver.island
    for t in range(islands[0], islands[1]):
        if solver.listed_of[t] > 0:
            slope[t] = curvature[t] = energy[t] = 0.0
    for e in range(solver.opened):
        q = solver.open_body[e]
        t, v, m = island[q], solver.velocity_before[q], solver.solver_mass[q]
        change = sub(solver.velocity[q], v)
        slope[t] += m * dot(v, change)
        curvature[t] += m * dot(change, change)
        energy[t] += m * dot(v, v)
        if len(arms) > 0:
            before = solver.spin_before[q]
            change = sub(solver.spin[q], before)
            momentum = momentum_of_spin(solver, q, before)
            slope[t] += dot(momentum, change)
            curvature[t] += dot(momentum_of_spin(solver, q, change), change)
            energy[t] += dot(momentum, before)
    add_work(solver, span, arms)


@part
def exceeds_budget(solver, t):
    """Whether the contacts of island t have given it more energy than ``allowed``."""
    curvature = solver.curvature[t]
    gained = solver.slope[t] - solver.allowed[t] + 0.5 * curvature
    return not gained <= GAIN_ROUNDING * (math.sqrt(solver.energy[t] * curvature) + curvature)


@part
def energy_budget(solver, bias_rate, h, dt, span, islands):
    """What each island may gain in a substep: what its joints have taken before in the step, what forces give from
    rest, more of that where it is pushed out, and without joints, which would use it in each substep, a small share of
    the energy at the speed of pushing."""
    allowed = solver.allowed
    for t in range(islands[0], islands[1]):
        force, rate = solver.force_of[t] * h / dt, dt / h if solver.size_of[t] > 0 else 1.0
        allowed[t] = solver.credit[t] + (0.5 + GAIN_WEIGHT * rate) * force * force / solver.mass_of[t]
    for k in range(span[0], span[1]):
        t, speed = island_of(solver, k), bias_rate * FULL_PUSH_OVERLAP * solver.extent[k]
        if solver.links[t] == 0:
            allowed[t] += h / dt * GAIN_PUSH * solver.mass[k] * speed * speed


@inlined
def gains_by_contacts(solver, t):
    """Whether further passes may take what island t has gained: those of contacts do not take what joints give."""
    return exceeds_budget(solver, t) and solver.links[t] == 0


@inlined
def excess_scale(solver, t):
    """How many times better than STRUCK_EXCESS the rows of a struck island are solved."""
    return max(1.0, ISLAND_WORK / (FINER_PASSES * (solver.size_of[t] + solver.links[t])))


@part
def find_unsolved_rows(solver, turn, any_struck, dt, span, arms, islands):
    """The rows of struck islands that are not solved, and all of islands that gain, come first in ``listed``; returns
    how many. An island has as many passes as its own size allows: what is solved elsewhere changes none of its bits."""
    struck, extent, any_gain, finest, count = solver.struck, solver.extent, False, 0.0, 0
    for t in range(islands[0], islands[1]):
        solver.listed_of[t] = 0
        any_gain |= gains_by_contacts(solver, t)
        finest = max(finest, excess_scale(solver, t) if struck[t] else 0.0)
    for k in range(span[0], span[1] if any_gain or any_struck else span[0]):
        excess, least = excess_speed(solver, k, arms) * dt, STRUCK_EXCESS * extent[k]
        if excess * finest > least or any_gain:  # seldom
            t = island_of(solver, k)
            wrong = struck[t] and excess * excess_scale(solver, t) > least
            rows = solver.size_of[t] + solver.links[t]
            if (wrong or gains_by_contacts(solver, t)) and turn <= most_repeats(rows):
                solver.listed[count] = k
                solver.listed_of[t] += 1
                count += 1
    if count > 0:
        list_open(solver, span, arms)
    return count


@part
def limit_energy(solver, span, arms, islands):
    """In islands that still gain only the share acts that takes the most energy: the least of E(s). Where there are
    joints the largest share acts that gives no more than is allowed."""
    start, stop, begin, end = span
    share, any_gain = solver.share, False
    for t in range(islands[0], islands[1]):
        share[t] = 1.0
        if exceeds_budget(solver, t):
            slope, curvature = solver.slope[t] - solver.allowed[t], solver.curvature[t]
            most = -slope / curvature
            if solver.links[t] > 0:  # all that is allowed, as joints are to hold
                root = math.sqrt(solver.slope[t] * solver.slope[t] + 2.0 * curvature * solver.allowed[t])
                most = (root - solver.slope[t]) / curvature
            share[t] = min(1.0, max(0.0, most)) if curvature < math.inf else 0.0
            solver.taken[t] += slope + 0.5 * curvature - share[t] * (slope + 0.5 * share[t] * curvature)
            any_gain = True
    for q in range(begin, end if any_gain else begin):
        t = solver.island[q]
        if t >= 0 and share[t] < 1.0:
            before = solver.velocity_before[q]
            change = sub(solver.velocity[q], before)
            solver.velocity[q] = add_scaled(before, change, share[t]) if share[t] > 0.0 else before
            if len(arms) > 0:
                turned = sub(solver.spin[q], solver.spin_before[q])
                solver.spin[q] = add_scaled(solver.spin_before[q], turned, share[t])
    for k in range(start, stop if any_gain else start):
        kept = share[island_of(solver, k)]
        if kept < 1.0:
            solver.impulse[k] *= kept
            solver.tangent[k] = scale(solver.tangent[k], kept)


@part
def carry_budget(solver, islands):
    """What joints have taken in a substep they may give back later in the step."""
    for t in range(islands[0], islands[1]):
        s = solver.share[t]
        if solver.links[t] > 0:
            solver.credit[t] = max(0.0, solver.credit[t] - s * (solver.slope[t] + 0.5 * s * solver.curvature[t]))
        else:
            solver.credit[t] = 0.0


@part
def finish_substep(solver, bias_rate, any_struck, h, dt, span, arms):
    """Further passes over the islands of a range that gain or are struck, then the bound on their energy."""
    islands, any_gain = islands_of(solver, span), False
    measure_energy(solver, span, arms, islands)
    for t in range(islands[0], islands[1]):
        solver.allowed[t], solver.share[t] = solver.credit[t], 1.0
        any_gain |= exceeds_budget(solver, t)
    if not (any_gain or any_struck):
        carry_budget(solver, islands)
        return
    energy_budget(solver, bias_rate, h, dt, span, islands)
    turn, count = 0, find_unsolved_rows(solver, 0, any_struck, dt, span, arms, islands)
    while count > 0:
        for_joints(solver, calls.RELAX_OPEN, NO_NUMBERS, span, arms)
        if len(arms) > 0 and not solver.surfaces_run:
            relax_pairs(solver, count, span)
        else:
            relax_listed(solver, count, arms)
        measure_energy(solver, span, arms, islands)
        turn += 1
        count = find_unsolved_rows(solver, turn, any_struck, dt, span, arms, islands)
    limit_energy(solver, span, arms, islands)
    carry_budget(solver, islands)
    open_all(solver, turn == 0, span, arms)
