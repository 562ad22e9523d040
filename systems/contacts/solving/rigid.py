"""Rigid contacts: those that would sag too much as soft ones, under a heavy load or under forces that move a body by
much of its size in a step. All contacts of their islands are solved until they agree.

Soft contacts sag by SAG times the way that forces make in a substep, and more by the ratio of the load to the lighter
body's mass; passes over rigid ones agree the slower the longer the chain and the higher that ratio. So each pass is
made a step of conjugate gradients, preconditioned by the pass itself: while the same contacts push, a chain of n agrees
after n steps at most, whatever the masses (J. Nocedal, S. Wright, "Numerical Optimization", 2006, ch. 5; ch. 16.7 for
the bounds). Islands do not know of each other.
"""

from __future__ import annotations

import math

from ....framework.compilation import part
from ....framework.vectors import add_scaled, dot, length, negative, sub
from ...islands import root_of
from .heavy_light_blocks import OPPOSED, bears_heavy, solve_blocks
from .passes import solve_friction, solve_normals
from .softness import SAG

MOST_SAG = 0.02  # of the extent: a contact that would sag more under its load is rigid,
MOST_DEEP_SAG = 0.004  # and one that is deep: a load keeps it from being pushed out
CONVERGED = 1e-5  # of the extent, per substep: what rigid contacts may be wrong by,
STEADY = 1e-3  # and of the speed that forces make in it
MOST_PASSES, FEWEST_PASSES = 200, 16  # over a small island and a large one
WORK = 50_000  # contacts that passes over an island may visit, if those are not the fewest


@part
def find_islands(solver):
    """Bodies that contacts join, without what cannot be moved: island[q] is the first of them."""
    island, inverse_mass = solver.island, solver.inverse_mass
    for q in range(solver.bodies):
        island[q] = q
    for k in range(solver.contacts):
        a, b = solver.first[k], solver.second[k]
        if inverse_mass[a] > 0.0 and inverse_mass[b] > 0.0:
            one, other = root_of(island, a), root_of(island, b)
            island[max(one, other)] = min(one, other)
    for q in range(solver.bodies):
        island[q] = root_of(island, q)
    solver.islands_known = True


@part
def island_of(solver, k):
    """The island of contact k."""
    a = solver.first[k]
    return solver.island[a] if solver.inverse_mass[a] > 0.0 else solver.island[solver.second[k]]


@part
def away_from_fixed(solver, k):
    """(whether contact k is with something that cannot be moved, the normal away from that, its speed along it)."""
    a, b, n = solver.first[k], solver.second[k], solver.normal[k]
    if solver.inverse_mass[a] == 0.0:
        return True, n, dot(solver.velocity[a], n)
    return solver.inverse_mass[b] == 0.0, negative(n), -dot(solver.velocity[b], n)


@part
def leave_squeezed(solver):
    """Islands between something that moves by itself and something else that cannot be moved stay soft: no impulse is
    high enough for them, and what stands still has the last word."""
    pushed, way, any_pushed = solver.going, solver.velocity_way, False
    for q in range(solver.bodies):
        pushed[q] = False
    for k in range(solver.contacts):
        fixed, n, speed = away_from_fixed(solver, k)
        r = island_of(solver, k)
        if fixed and speed > 0.0 and not pushed[r]:
            pushed[r] = any_pushed = True
            way[r] = n
    for k in range(solver.contacts if any_pushed else 0):
        fixed, n, _ = away_from_fixed(solver, k)
        r = island_of(solver, k)
        if fixed and pushed[r] and dot(n, way[r]) < OPPOSED:
            solver.open[r] = False


@part
def harden_loaded(solver, h):
    """In islands of light and heavy bodies contacts become rigid that would sag too much."""
    if not solver.islands_known:
        find_islands(solver)
    for q in range(solver.bodies):
        solver.open[q] = False
    for k in range(solver.contacts):
        solver.open[island_of(solver, k)] |= bears_heavy(solver, k)
    for k in range(solver.contacts):
        most = (MOST_DEEP_SAG if solver.deep[k] else MOST_SAG) * solver.extent[k] * solver.mass[k]
        if solver.open[island_of(solver, k)] and SAG * solver.impulse[k] * h > most:
            solver.rigid[k] = solver.any_rigid = True


@part
def choose_rigid(solver, h):
    """Which contacts are rigid, and what they may be wrong by; returns whether there are any. ``converging``: those of
    their islands."""
    if solver.any_uneven:
        harden_loaded(solver, h)
    if not solver.any_rigid:
        return False
    if not solver.islands_known:
        find_islands(solver)
    for q in range(solver.bodies):
        solver.open[q] = False
    for k in range(solver.contacts):
        if solver.rigid[k]:
            solver.open[island_of(solver, k)] = True
    leave_squeezed(solver)
    for k in range(solver.contacts):
        solver.converging[k] = solver.open[island_of(solver, k)]
        a, b = solver.acceleration[solver.first[k]], solver.acceleration[solver.second[k]]
        wrong, forced = CONVERGED * solver.extent[k] / h, STEADY * max(length(a), length(b)) * h
        solver.tolerance[k] = (min(wrong, forced) if forced > 0.0 else wrong) * solver.mass[k]
    return True


@part
def leave_out_rigid(solver):
    """The passes that follow are for the other islands."""
    for k in range(solver.contacts):
        solver.active[k] = not solver.converging[k]


@part
def start_pass(solver, bias, give, near, h):
    """Keep what is before a pass, and what each contact asks of the speed along its normal: the gradient of what is
    minimised. Contacts that are active: of open islands, and not to close by more than ``near`` extents."""
    velocity, normal, first, second = solver.velocity, solver.normal, solver.first, solver.second
    for k in range(solver.contacts):
        solver.active[k] = solver.open[island_of(solver, k)] and bias[k] * h <= near * solver.extent[k]
        solver.previous[k] = solver.impulse[k]
        solver.error[k] = dot(sub(velocity[second[k]], velocity[first[k]]), normal[k]) + bias[k]
        if solver.soft[k]:
            solver.error[k] += give / solver.mass[k] * solver.impulse[k]
    for q in range(solver.bodies):
        solver.velocity_before[q] = velocity[q]
        solver.worst[q] = 0.0


@part
def close_settled(solver, turn):
    """Islands whose pass has changed nothing that matters are done, or have had all theirs; returns whether others are
    left."""
    any_open = False
    for k in range(solver.contacts):
        if solver.active[k]:
            r = island_of(solver, k)
            change = abs(solver.impulse[k] - solver.previous[k])
            if not change <= solver.tolerance[k]:
                solver.worst[r] = 1.0
    for q in range(solver.bodies):
        if solver.open[q] and solver.island[q] == q:
            most = min(MOST_PASSES, max(FEWEST_PASSES, WORK // max(1, solver.size[q])))
            solver.open[q] = solver.worst[q] > 0.0 and turn < most
            any_open |= solver.open[q]
    return any_open


@part
def make_conjugate(solver, give):
    """Of each open island the change that the pass has made, conjugate to the last direction, becomes the direction."""
    velocity, before, way = solver.velocity, solver.velocity_before, solver.velocity_way
    inverse_mass = solver.inverse_mass
    impulse, previous, direction = solver.impulse, solver.previous, solver.direction
    across, along = solver.across, solver.along
    for q in range(solver.bodies):
        across[q] = along[q] = 0.0
    for q in range(solver.bodies):
        r = solver.island[q]
        if inverse_mass[q] > 0.0 and solver.open[r] and solver.going[r]:
            across[r] += dot(sub(velocity[q], before[q]), way[q]) / inverse_mass[q]
            along[r] += dot(way[q], way[q]) / inverse_mass[q]
    for k in range(solver.contacts):
        if solver.active[k] and solver.soft[k]:
            r = island_of(solver, k)
            if solver.going[r]:
                across[r] += give / solver.mass[k] * direction[k] * (impulse[k] - previous[k])
                along[r] += give / solver.mass[k] * direction[k] * direction[k]
    for q in range(solver.bodies):
        across[q] = -across[q] / along[q] if along[q] > 0.0 else 0.0
    for q in range(solver.bodies):
        r = solver.island[q]
        if inverse_mass[q] > 0.0 and solver.open[r]:
            change = sub(velocity[q], before[q])
            way[q] = add_scaled(change, way[q], across[r]) if solver.going[r] else change
    for k in range(solver.contacts):
        r = island_of(solver, k)
        if solver.open[r]:
            change = impulse[k] - previous[k]
            direction[k] = change + across[r] * direction[k] if solver.going[r] else change


@part
def measure_step(solver, give):
    """``far``: how far it is best to go along the direction of each open island; ``stopper``: the contact that stops it
    earlier, because it would pull, or -1."""
    way, inverse_mass, direction = solver.velocity_way, solver.inverse_mass, solver.direction
    slope, curvature, far, stopper = solver.across, solver.along, solver.far, solver.stopper
    for q in range(solver.bodies):
        slope[q] = curvature[q] = 0.0
    for q in range(solver.bodies):
        r = solver.island[q]
        if inverse_mass[q] > 0.0 and solver.open[r]:
            curvature[r] += dot(way[q], way[q]) / inverse_mass[q]
    for k in range(solver.contacts):
        r = island_of(solver, k)
        if solver.open[r]:
            slope[r] += direction[k] * solver.error[k]
            if solver.soft[k]:
                curvature[r] += give / solver.mass[k] * direction[k] * direction[k]
    for q in range(solver.bodies):
        # Contacts that push against each other may change without any body: as far as none of them pulls.
        endless = math.inf if slope[q] < 0.0 else 0.0
        far[q] = -slope[q] / curvature[q] if curvature[q] > 0.0 else endless
        stopper[q] = -1
    for k in range(solver.contacts):
        r = island_of(solver, k)
        if solver.open[r] and solver.previous[k] + far[r] * direction[k] < 0.0:
            far[r], stopper[r] = -solver.previous[k] / direction[k], k
    for q in range(solver.bodies):
        far[q] = far[q] if far[q] < math.inf else 0.0


@part
def go(solver):
    """Take these steps; an island that cannot go keeps what the pass has made of it."""
    velocity, impulse, far, going = solver.velocity, solver.impulse, solver.far, solver.going
    for k in range(solver.contacts):
        r = island_of(solver, k)
        if solver.open[r] and far[r] > 0.0:
            impulse[k] = max(0.0, solver.previous[k] + far[r] * solver.direction[k])
            if solver.stopper[r] == k:
                impulse[k] = 0.0
    for q in range(solver.bodies):
        r = solver.island[q]
        if solver.inverse_mass[q] > 0.0 and solver.open[r] and far[r] > 0.0:
            velocity[q] = add_scaled(solver.velocity_before[q], solver.velocity_way[q], far[r])
    for q in range(solver.bodies):
        going[q] = far[q] > 0.0 and solver.stopper[q] < 0


@part
def converge(solver, bias, softness, pushes, near, h):
    """Passes over the islands with rigid contacts until they agree; only over contacts within ``near`` extents."""
    give = softness[1] / softness[0] if pushes else 0.0
    for q in range(solver.bodies):
        solver.open[q] = solver.going[q] = False
        solver.size[q] = 0
    for k in range(solver.contacts):
        solver.open[island_of(solver, k)] |= solver.converging[k]
        solver.size[island_of(solver, k)] += 1
    for turn in range(MOST_PASSES):
        start_pass(solver, bias, give, near, h)
        solve_normals(solver, bias, softness, pushes, True)
        solve_blocks(solver, bias, True)
        if not close_settled(solver, turn):
            break
        make_conjugate(solver, give)
        measure_step(solver, give)
        go(solver)
    if solver.has_friction:
        for k in range(solver.contacts):
            solver.active[k] = solver.converging[k]
        solve_friction(solver, True)
