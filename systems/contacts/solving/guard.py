"""What the usual passes of a substep leave undone: further passes over rows that are not solved, and a bound on the
energy that rows give.

Contacts at rest take energy from their island. Impulses that were those of another moment may give some. What is more
than a bounded push is taken back: of all that the contacts have changed only the share acts that takes the most.
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
from .chunks import relax_pair
from .passes import most_repeats
from .rows import excess_speed, relax_row, velocity_at

NO_NUMBERS = 0.0, 0.0
LISTED_NOT = -1


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
def measure_energy(solver, span, arms, islands):
    """What contacts do to the energy of each island if a share s of all that they have changed acts: E(s) = slope s +
    curvature s^2 / 2, which is exact, without the work of what moves by itself: that is no gain of contacts."""
    slope, curvature, energy, island = solver.slope, solver.curvature, solver.energy, solver.island
    for t in range(islands[0], islands[1]):
        slope[t] = curvature[t] = energy[t] = 0.0
    for q in range(span[2], span[3]):
        t, v, m = island[q], solver.velocity_before[q], solver.solver_mass[q]
        if t < 0:
            continue
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
    for k in range(span[0], span[1] if solver.movers > 0 or solver.surfaces_run else span[0]):
        slope[island_of(solver, k)] += work_of_row(solver, k, arms)
    for_joints(solver, calls.ADD_WORK, NO_NUMBERS, span, arms)


@part
def exceeds_budget(solver, t):
    """Whether the contacts of island t have given it more energy than ``allowed``."""
    curvature = solver.curvature[t]
    gained = solver.slope[t] - solver.allowed[t] + 0.5 * curvature
    return not gained <= GAIN_ROUNDING * (math.sqrt(solver.energy[t] * curvature) + curvature)


@part
def energy_budget(solver, springs, h, dt, span, islands):
    """What each island may gain in a substep: what its joints have taken before in the step, what forces give from
    rest, more of that where it is pushed out, and without joints, which would use it in each substep, a small share of
    the energy at the speed of pushing."""
    allowed = solver.allowed
    for t in range(islands[0], islands[1]):
        force, rate = solver.force_of[t] * h / dt, dt / h if solver.size_of[t] > 0 else 1.0
        allowed[t] = solver.credit[t] + (0.5 + GAIN_WEIGHT * rate) * force * force / solver.mass_of[t]
    for k in range(span[0], span[1]):
        t = island_of(solver, k)
        if solver.links[t] == 0:
            speed = springs[1 if solver.tips[t] else 0][1] * FULL_PUSH_OVERLAP * solver.extent[k]
            allowed[t] += h / dt * GAIN_PUSH * solver.mass[k] * speed * speed


@inlined
def is_unsolved(solver, k, t, dt, arms):
    """Whether the speed of row k is still wrong, of an island t with a ``share``, see ``find_unsolved_rows``."""
    return excess_speed(solver, k, arms) * dt * solver.share[t] > STRUCK_EXCESS * solver.extent[k]


@part
def find_unsolved_rows(solver, turn, dt, span, arms):
    """How many rows of struck islands are not solved. They are listed from the first one on, which is returned as well;
    so are those without joints that were listed before, as what is solved at one spoils its neighbours. An island has
    as many turns as its own size allows: what is solved elsewhere changes none of its bits; small ones are solved as
    many times better as their ``share`` says."""
    islands, following, share, stop = islands_of(solver, span), solver.listed, solver.share, span[1]
    count, head, last, largest = 0, stop, -1, 0.0
    for t in range(islands[0], islands[1]):
        rows, left = solver.size_of[t] + solver.links[t], solver.struck[t] if turn == 0 else solver.listed_of[t] > 0
        left &= turn <= most_repeats(rows)
        share[t] = max(1.0, ISLAND_WORK / (FINER_PASSES * rows)) if left else 0.0
        solver.listed_of[t] = 0
        largest = max(largest, share[t])
    for k in range(span[0], stop if largest > 0.0 else span[0]):
        before, excess = turn > 0 and following[k] > LISTED_NOT, excess_speed(solver, k, arms)
        following[k] = LISTED_NOT
        if before or excess * dt * largest > STRUCK_EXCESS * solver.extent[k]:  # seldom
            t = island_of(solver, k)
            new = is_unsolved(solver, k, t, dt, arms)
            count += new
            if new or (before and share[t] > 0.0 and solver.links[t] == 0):
                solver.listed_of[t] += 1
                if last < 0:
                    head = k
                else:
                    following[last] = k
                last, following[k] = k, stop
    return count, head


@part
def relax_unsolved(solver, head, dt, span, arms):
    """A pass over the rows that are listed from ``head`` on, and the joints of their islands; where there are none more
    passes over those that are not solved, of about as much work as to look at all rows of the island again."""
    for_joints(solver, calls.RELAX_LISTED, NO_NUMBERS, span, arms)
    passes, any_relaxed = 0, True
    while any_relaxed:
        any_relaxed, k, start, c = False, head, span[0], solver.first_chunk
        while k < span[1]:
            t = island_of(solver, k)
            more = passes == 0 or solver.links[t] == 0
            if more and passes * solver.listed_of[t] < solver.size_of[t] and is_unsolved(solver, k, t, dt, arms):
                any_relaxed = True
                solver.visits += 1
                if len(arms) > 0:
                    while solver.ends[c] <= k:
                        start, c = solver.ends[c], c + 1
                    relax_pair(solver, k, start, c)
                else:
                    relax_row(solver, k, arms)
            k = solver.listed[k]
        passes += 1


@part
def limit_energy(solver, span, arms, islands):
    """In islands that still gain only the share acts that takes the most energy: the least of E(s). Where there are
    joints the largest share acts that gives no more than is allowed."""
    share, island, any_gain = solver.share, solver.island, False
    for t in range(islands[0], islands[1]):
        if exceeds_budget(solver, t):
            slope, curvature, allowed = solver.slope[t], solver.curvature[t], solver.allowed[t]
            gain = slope - allowed
            most = -gain / curvature
            if solver.links[t] > 0:  # all that is allowed, as joints are to hold
                most = (math.sqrt(slope * slope + 2.0 * curvature * allowed) - slope) / curvature
            kept = min(1.0, max(0.0, most)) if curvature < math.inf else 0.0
            solver.taken[t] += gain + 0.5 * curvature - kept * (gain + 0.5 * kept * curvature)
            share[t], any_gain = kept, True
    velocity, spin = solver.velocity, solver.spin
    for q in range(span[2], span[3] if any_gain else span[2]):
        t = island[q]
        if t >= 0 and share[t] < 1.0:
            before = solver.velocity_before[q]
            velocity[q] = add_scaled(before, sub(velocity[q], before), share[t]) if share[t] > 0.0 else before
            if len(arms) > 0:
                spun = solver.spin_before[q]
                spin[q] = add_scaled(spun, sub(spin[q], spun), share[t])
    for k in range(span[0], span[1] if any_gain else span[0]):
        kept = share[island_of(solver, k)]
        if kept < 1.0:
            solver.impulse[k] *= kept
            solver.tangent[k] = scale(solver.tangent[k], kept)


@part
def carry_budget(solver, islands):
    """What joints have taken in a substep they may give back later in the step."""
    for t in range(islands[0], islands[1] if solver.joints.active > 0 or solver.lopsided else islands[0]):
        s = solver.share[t]
        left = solver.credit[t] - s * (solver.slope[t] + 0.5 * s * solver.curvature[t])
        solver.credit[t] = max(0.0, left) if solver.links[t] > 0 else 0.0


@part
def finish_substep(solver, springs, any_struck, h, dt, span, arms):
    """Further passes over the struck islands of a range, then the bound on the energy of all."""
    islands, turn, count, any_gain = islands_of(solver, span), 0, int(any_struck), False
    while count > 0:
        count, head = find_unsolved_rows(solver, turn, dt, span, arms)
        turn += 1
        if count > 0:
            relax_unsolved(solver, head, dt, span, arms)
    measure_energy(solver, span, arms, islands)
    for t in range(islands[0], islands[1]):
        solver.allowed[t], solver.share[t] = solver.credit[t], 1.0
        any_gain |= exceeds_budget(solver, t)
    if any_gain:
        energy_budget(solver, springs, h, dt, span, islands)
        limit_energy(solver, span, arms, islands)
    carry_budget(solver, islands)
