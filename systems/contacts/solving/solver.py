"""The solver of contacts at rest: soft constraints, solved in each of a few substeps.

After Box2D v3's "soft step" (E. Catto, "Solver2D", 2024): per substep the forces act, last substep's impulses are
applied again, one pass pushes overlapping bodies apart like a stiff, overdamped spring, the bodies move, and relaxing
passes take back the speed that pushing has given them. The spring's frequency follows the rate of the substeps, so
that more of them mean stiffer contacts.

Contacts come sorted by colour: no two neighbours in the order move the same body, so that the processor can work on
several at once.
"""

from __future__ import annotations

import math

from ....framework.compilation import packed, part
from ....framework.vectors import add, add_scaled, dot, scale, sub
from ...codes import OK
from .firm import leave_open
from .heavy_light_blocks import hold_light, solve_blocks
from .passes import solve_friction, solve_normals
from .rigid import choose_rigid, converge, leave_out_rigid
from .shocks import closes_fast, solve_shocks
from .softness import DAMPING_RATIO, FREQUENCY

RELAX_PASSES = 2
LAST_RELAX_PASSES = 4  # of the last substep, whose velocities stay
LET_GO_PASSES = 4  # once, after contacts have been lost
DEEP = 0.02  # of the extent: overlap beyond it is pushed out in position only, for a speed given to many adds up
PUSH_RATE = 0.2  # of the deep overlap, per step
PUSH_LIMIT = 0.05  # of the extent, per step


@part
def measure(solver, k, h, bias_rate):
    """What contact k asks of the speed along its normal, from where the bodies are now.

    opening: at most closing what is open within a substep; pushing: in the pass that pushes, overlap is to open as
    well, softly where ``soft`` says so, unless it is too ``deep`` for that.
    """
    room = solver.gap[k] + dot(sub(solver.shift[solver.second[k]], solver.shift[solver.first[k]]), solver.normal[k])
    opening = pushing = max(0.0, room) / h
    soft = deep = False
    if room <= 0.0 and not solver.parting[k]:
        deep = room < -DEEP * solver.extent[k]
        if solver.rigid[k] or not deep:
            pushing = bias_rate * max(room, -DEEP * solver.extent[k])
            soft = not (solver.rigid[k] or solver.in_block[k] or solver.firm[k])
    solver.opening[k], solver.pushing[k], solver.soft[k], solver.deep[k] = opening, pushing, soft, deep


@part
def measure_all(solver, h, bias_rate, dt):
    """The same of all contacts, and which have pushed; returns (whether some are too deep, whether some close as fast
    as shocks)."""
    any_deep = any_fast = False
    for k in range(solver.contacts):
        solver.worked[k] |= solver.impulse[k] > 0.0
        measure(solver, k, h, bias_rate)
        any_deep |= solver.deep[k]
        any_fast |= closes_fast(solver, k, dt)
    return any_deep, any_fast


@part
def measure_moved(solver, h, bias_rate, dt):
    """The same of the contacts of bodies that were pushed apart; returns whether some close as fast as shocks."""
    moved, any_fast = solver.going, False
    for k in range(solver.contacts):
        if moved[solver.first[k]] or moved[solver.second[k]]:
            measure(solver, k, h, bias_rate)
            any_fast |= closes_fast(solver, k, dt)
    return any_fast


@part
def propagate(solver, begins):
    """The contacts of unsettled bodies are active, and unsettle the bodies on their other sides; in the pass that
    begins only those that do not wait, so that these bear the load."""
    unsettled, inverse_mass, active = solver.unsettled, solver.inverse_mass, solver.active
    for k in range(solver.contacts):
        a, b = solver.first[k], solver.second[k]
        active[k] = (unsettled[a] and inverse_mass[a] > 0.0) or (unsettled[b] and inverse_mass[b] > 0.0)
    for k in range(solver.contacts):
        if active[k]:
            unsettled[solver.first[k]] = unsettled[solver.second[k]] = True
            active[k] = not (begins and solver.waits[k])


@part
def push_deep(solver, substeps):
    """Move bodies that overlap deeply apart, a part of the way, without giving them speed."""
    shift, inverse_mass, moved = solver.shift, solver.inverse_mass, solver.going
    for q in range(solver.bodies):
        moved[q] = False
    for k in range(solver.contacts):
        a, b, n = solver.first[k], solver.second[k], solver.normal[k]
        if not (solver.deep[k] or moved[a] or moved[b]):
            continue
        overlap = -solver.gap[k] - dot(sub(shift[b], shift[a]), n)
        if overlap > DEEP * solver.extent[k] and not (solver.parting[k] or solver.rigid[k]):
            push = min(PUSH_RATE * overlap, PUSH_LIMIT * solver.extent[k]) / substeps * solver.mass[k]
            shift[a] = add_scaled(shift[a], n, -push * inverse_mass[a])
            shift[b] = add_scaled(shift[b], n, push * inverse_mass[b])
            solver.worked[k] = moved[a] = moved[b] = True


@part
def apply_warm_start(solver, h):
    """The forces of a substep act, and the impulses of the last one again."""
    velocity, inverse_mass, impulse = solver.velocity, solver.inverse_mass, solver.impulse
    for q in range(solver.bodies):
        velocity[q] = add_scaled(velocity[q], solver.acceleration[q], h)
    for k in range(solver.contacts):
        if impulse[k] > 0.0:
            push = scale(solver.normal[k], impulse[k])
            if solver.has_friction:
                push = add(push, solver.tangent[k])
            a, b = solver.first[k], solver.second[k]
            if inverse_mass[a] > 0.0:
                velocity[a] = add_scaled(velocity[a], push, -inverse_mass[a])
            if inverse_mass[b] > 0.0:
                velocity[b] = add_scaled(velocity[b], push, inverse_mass[b])


@part
def solve_substep(solver, h, substeps, passes, plastic, ends):
    """One substep; passes: (how many before the one that pushes, how many after it); ends: it is the last one."""
    omega = 2.0 * math.pi * FREQUENCY / h
    damping = 2.0 * DAMPING_RATIO + h * omega
    stiffness = h * omega * damping
    bias_rate = omega / damping
    softness = stiffness / (1.0 + stiffness), 1.0 / (1.0 + stiffness)
    any_rigid = choose_rigid(solver, h)
    apply_warm_start(solver, h)
    turn, last = -passes[0], passes[1]
    while turn <= last:
        if turn < 0:
            propagate(solver, turn == -passes[0])
        elif any_rigid:
            leave_out_rigid(solver)
        chosen = turn < 0 or any_rigid
        bias = solver.pushing if turn == 0 else solver.opening
        solver.visits += solver.contacts
        solve_normals(solver, bias, softness, turn == 0, chosen)
        solve_blocks(solver, bias, chosen)
        if solver.has_friction:
            solve_friction(solver, chosen)
        if any_rigid and turn >= 0:
            if turn == 0:
                converge(solver, bias, softness, True, DEEP, h)
            converge(solver, bias, softness, turn == 0, math.inf, h)
        if turn == 0:
            for q in range(solver.bodies):
                solver.shift[q] = add_scaled(solver.shift[q], solver.velocity[q], h)
            any_deep, any_fast = measure_all(solver, h, bias_rate, h * substeps)
            if any_deep:
                push_deep(solver, substeps)
                any_fast |= measure_moved(solver, h, bias_rate, h * substeps)
            if ends:
                leave_open(solver, h)
            if plastic and any_fast:
                solve_shocks(solver, h * substeps)
        turn += 1
    for k in range(solver.contacts):
        solver.total[k] += solver.impulse[k]
        solver.worked[k] |= solver.impulse[k] > 0.0


@packed
def solve_contacts(state, dt):
    """Advance the bodies by the step's substeps under their mean acceleration and their contacts.

    What closes fast is a shock where nothing has bounced in this step. Where a contact that pushed in the last step has
    gone, the others push too much: these let go before anything else, and their neighbours.
    """
    solver, substeps = state.solver, state.substeps
    if solver.contacts == 0:
        return OK
    h = dt / substeps
    omega = 2.0 * math.pi * FREQUENCY / h
    _, any_fast = measure_all(solver, h, omega / (2.0 * DAMPING_RATIO + h * omega), dt)
    for k in range(solver.contacts):
        solver.total[k], solver.worked[k], solver.shock[k] = 0.0, False, 0.0
    solver.islands_known = solver.linked = False
    solver.shock_visits = solver.visits = 0
    plastic = state.impacts.logged == 0
    if plastic and any_fast:
        solve_shocks(solver, dt)
    for step in range(substeps):
        before = LET_GO_PASSES if solver.any_unsettled and step == 0 else 0
        ends = step == substeps - 1
        after = LAST_RELAX_PASSES if ends else RELAX_PASSES
        solve_substep(solver, h, substeps, (before, after), plastic, ends)
    hold_light(state, dt)
    return OK
