"""The solver of contacts at rest: soft constraints, solved in each of a few substeps.

After Box2D v3's "soft step" (E. Catto, "Solver2D", 2024): per substep the forces act, the impulses of the last one are
applied again, one pass pushes overlapping bodies apart like a stiff, overdamped spring, the bodies move, and relaxing
passes take back the speed that pushing has given them. The spring's frequency follows the rate of the substeps: more of
them mean stiffer contacts. Where loads or blows ask for it, an island has more than others (see islands); what the
passes leave undone gives no energy (see guard).
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, packed, part
from ....framework.jit.records.record_type import zero_of
from ....framework.vectors import add, add_scaled, dot, scale
from ...codes import OK
from ...joints import calls
from ...joints.calls import for_joints
from ...linking.parts import TUMBLE, call_tumble
from ..constants import (
    DAMPING_RATIO,
    FREQUENCY,
    FULL_PUSH_OVERLAP,
    LAST_RELAX_PASSES,
    NEGLIGIBLE,
    REFINED_PASSES,
    RELAX_PASSES,
    STATIC_STIFFNESS,
    STRUCK_EXCESS,
    TURNING_FREQUENCY,
    TURNING_RELAX_PASSES,
)  # fmt: skip
from .chunks import find_chunks, load_masses, measure_chunks
from .guard import finish_substep, island_of, islands_of
from .hard import select_rigid
from .islands import is_hard_island
from .overload import cap_mass_ratio, restore_mass
from .passes import close_nearest_first, note_impulses, solve_passes
from .records import RESTRAINED, note_fault
from .rows import (
    ARMS,
    NO_ARMS,
    apply_impulse,
    closing_speed,
    compute_effective_mass,
    excess_speed,
    integrate_rotation,
    leave_open_rows,
    rotate_body,
    separation,
    turn_arms,
    update_targets,
)

SQUARE_OF_TURN = tuple((2.0 * math.pi * frequency) ** 2 for frequency in (FREQUENCY, TURNING_FREQUENCY))  # rad of a
# spring in a substep


@part
def measure(solver, h, dt, ends, span, arms):
    """What each row asks of the speed along its normal, from where the bodies are now.

    opening: at most closing what is open within a substep, or, in the one that ``ends`` the step, within a usual one;
    pushing: in the pass that pushes, overlap is to open as well. Islands are ``struck`` where the speed of some row is
    far from what the relaxing passes are to make of it; returns whether any is.
    """
    ahead, any_struck, islands = dt / solver.usual if ends else h, False, islands_of(solver, span)
    for t in range(islands[0], islands[1]):
        solver.struck[t] = False
    if len(arms) > 0:
        turn_arms(solver, 1.0, span, arms)
        any_struck = measure_chunks(solver, ahead, dt, span)
    for k in range(span[0], span[1] if len(arms) == 0 else span[0]):
        room, closing = separation(solver, k, arms), closing_speed(solver, k, arms)
        any_struck |= update_targets(solver, k, room, closing, ahead, dt)
    if ends:
        leave_open_rows(solver, h, span, arms)
    for k in range(span[0], span[1] if any_struck else span[0]):
        if excess_speed(solver, k, arms) * dt > STRUCK_EXCESS * solver.extent[k]:
            solver.struck[island_of(solver, k)] = True
    return any_struck


@part
def apply_forces(solver, h, span, arms):
    """The forces of a substep act; ``velocity_before`` is what they make of the velocities without any contact."""
    for q in range(span[2], span[3]):
        v = add_scaled(solver.velocity[q], solver.acceleration[q], h)
        solver.velocity[q], solver.velocity_before[q] = v, v
        if len(arms) > 0:
            solver.spin_before[q] = solver.spin[q]


@part
def apply_warm_start(solver, times, span, arms):
    """The impulses of the last substep act again."""
    for_joints(solver, calls.START_WARM, times, span, arms)
    for k in range(span[0], span[1] if len(arms) > 0 and solver.has_rolling else span[0]):
        solver.rolled[k] = scale(solver.normal[k], 0.0)
    for k in range(span[0], span[1]):
        if solver.impulse[k] > 0.0:
            push = scale(solver.normal[k], solver.impulse[k])
            if solver.has_friction:
                push = add(push, solver.tangent[k])
            apply_impulse(solver, k, push, arms)


@part
def integrate_positions(solver, h, span, arms):
    """Bodies move for a substep; what moves by itself belongs to no special range, but moves with each of them."""
    if len(arms) > 0:
        turn_arms(solver, -1.0, span, arms)
    shift, velocity = solver.shift, solver.velocity
    for q in range(span[2], span[3]):
        shift[q] = add_scaled(shift[q], velocity[q], h)
    for m in range(solver.movers if span[2] > 0 else 0):
        q = solver.mover[m]
        shift[q] = add_scaled(shift[q], velocity[q], h)
        if len(arms) > 0:
            rotate_body(solver, q, add_scaled(solver.turn[q], solver.spin[q], h))
    if len(arms) > 0 and len(velocity[span[2]]) == 3 and (solver.joints.active > 0 or solver.lopsided):
        call_tumble(solver.addresses[TUMBLE], solver, h, span)
        load_masses(solver, span)
    elif len(arms) > 0:
        integrate_rotation(solver, span[2], span[3], h)


@part
def rule_of(solver, s, dt, span, arms):
    """(substeps, passes in each that take back the speed that pushing has given, the same in the last one, whether
    they go on until they agree, whether masses are capped) of a range. More passes would pull joints apart, which have
    one."""
    passes, last = RELAX_PASSES, LAST_RELAX_PASSES
    if len(arms) > 0:
        passes = last = TURNING_RELAX_PASSES
    if s == 0:
        return solver.usual, passes, last, False, False
    t = solver.island[span[2]]
    if solver.links[t] == 0:
        passes = last = REFINED_PASSES
    hard = is_hard_island(solver, t, solver.usual, dt)
    return solver.substeps_of[t], passes, last, hard, solver.load_share[t] < 1.0


@part
def solve_substep(solver, springs, times, rule, ends, span, arms):
    """One substep of a range. springs: see ``contact_spring``; times: s, of a substep and of the step."""
    (h, dt), (_, passes, last, stiff, capped), start, stop = times, rule, span[0], span[1]
    apply_forces(solver, h, span, arms)
    apply_warm_start(solver, times, span, arms)
    if stiff:
        close_nearest_first(solver, h, span, arms)
    for_joints(solver, calls.PUSH, times, span, arms)
    solve_passes(solver, True, 1, stiff, h, span, arms)
    for_joints(solver, calls.PUSH_AGAIN, times, span, arms)
    integrate_positions(solver, h, span, arms)
    if capped:
        restore_mass(solver, h, span, arms)
    any_struck = measure(solver, h, dt, ends, span, arms)
    for_joints(solver, calls.RELAX, times, span, arms)
    solve_passes(solver, False, last if ends else passes, stiff, h, span, arms)
    for_joints(solver, calls.RELAX_AGAIN, times, span, arms)
    finish_substep(solver, springs, any_struck, h, dt, span, arms)
    if capped:
        restore_mass(solver, 0.0, span, arms)
    for k in range(start, stop):
        solver.total[k] += solver.impulse[k]
        solver.peak[k] = max(solver.peak[k], solver.impulse[k])
    for_joints(solver, calls.ADD, times, span, arms)


@part
def is_still(solver, dt, span, arms):
    """Whether an island rests, and its last substep has changed nothing that matters: those that follow would not."""
    start, stop, begin, end = span
    extent, fastest, changes = math.inf, 0.0, False
    if len(arms) > 0 and solver.joints.begin < solver.joints.end:
        return False
    for q in range(begin, end):
        fastest = max(fastest, dot(solver.velocity[q], solver.velocity[q]))
        if len(arms) > 0:
            around = scale(solver.spin[q], solver.reach[q])
            fastest = max(fastest, dot(around, around))
    for k in range(start, stop):
        extent, push = min(extent, solver.extent[k]), solver.impulse[k]
        changes |= abs(push - solver.previous[k]) > NEGLIGIBLE * push
    return not changes and math.sqrt(fastest) * dt <= NEGLIGIBLE * extent


@part
def scale_impulses(solver, by, span):
    """Impulses of a step become those of one of its substeps, or the other way."""
    for k in range(span[0], span[1]):
        solver.impulse[k] *= by
        solver.tangent[k] = scale(solver.tangent[k], by)


@part
def contact_spring(solver, frequency, substeps, h, slow):
    """(share of its impulse that a soft row gives back, speed per overlap at which it is pushed out) where springs have
    a frequency, times the rate of the substeps; ``slow`` times as slow, as a step before was longer.

    Where there are more substeps than usual springs are damped by as much more: for the heavy bodies that they bear,
    and so that overlap is pushed out at the usual rate.
    """
    omega = 2.0 * math.pi * frequency / (h * slow)
    damping = 2.0 * DAMPING_RATIO * substeps / solver.usual + h * omega
    return 1.0 / (1.0 + h * omega * damping), omega / damping


@inlined
def set_spring(solver, k, springs, times, stiff, arms):
    """How row k pushes overlap out, see ``contact_spring``: softer in an island where some pair has several points, but
    less so where one of its bodies cannot be moved, at once where it is hard, not at all where it parts. It sags under
    the impulse of the last step."""
    hard, parting, tips = solver.hard[k], solver.parting[k], int(solver.tips[island_of(solver, k)])
    h, slow = times
    held = solver.inverse_mass[solver.first[k]] == 0.0 or solver.inverse_mass[solver.second[k]] == 0.0
    soft, bias_rate = springs[2 * tips if held else tips]
    sag = 0.0 if stiff else solver.impulse[k] * h * slow * slow / (SQUARE_OF_TURN[tips] * solver.mass[k])
    at_once = parting or (hard and (len(arms) == 0 or len(solver.normal[k]) == 2))  # on three points it would rock on
    solver.push_rate[k] = 1.0 / h if at_once else bias_rate
    solver.most_push[k] = 0.0 if parting else -bias_rate * (FULL_PUSH_OVERLAP * solver.extent[k] + sag)
    solver.soft[k] = 0.0 if stiff or hard or parting else soft


@part
def solve_range(solver, s, dt, span, arms):
    """The substeps of a range."""
    rule, special = rule_of(solver, s, dt, span, arms), s > 0
    substeps, _, _, stiff, capped = rule
    h, slow = dt / substeps, solver.joints.period / (dt / solver.usual)
    if capped:
        cap_mass_ratio(solver, solver.island[span[2]], dt, span, arms)
    springs = (
        contact_spring(solver, FREQUENCY, substeps, h, slow),
        contact_spring(solver, TURNING_FREQUENCY, substeps, h, slow),
        contact_spring(solver, STATIC_STIFFNESS * TURNING_FREQUENCY, substeps, h, slow),
    )
    if len(arms) > 0:
        find_chunks(solver, span)
        load_masses(solver, span)
    scale_impulses(solver, 1.0 / substeps, span)
    for k in range(span[0], span[1]):
        set_spring(solver, k, springs, (h, slow), stiff, arms)
    for_joints(solver, calls.START, (h, dt), span, arms)
    measure(solver, h, dt, False, span, arms)
    for step in range(substeps):
        left = substeps - 1 - step
        if special:
            note_impulses(solver, span)
        solve_substep(solver, springs, (h, dt), rule, left == 0, span, arms)
        if special and left > 0 and is_still(solver, dt, span, arms):  # those that are left do what this one did
            for k in range(span[0], span[1]):
                solver.total[k] += left * solver.impulse[k]
            integrate_positions(solver, left * h, span, arms)
            break
    scale_impulses(solver, float(substeps), span)
    for_joints(solver, calls.KEEP, (h, dt), span, arms)


@part
def count_work(state, dt):
    """Counters of the step, and what faults will tell: islands that contacts would have given much energy."""
    solver = state.solver
    state.islands_counted += solver.islands
    state.refined_counted += solver.ranges - 1
    state.solved_counted += solver.visits
    for t in range(solver.islands):
        taken = solver.taken[t]
        if taken > 0.0:
            state.restrained_counted += 1
            state.restrained_energy += taken
            each = 2.0 * taken / solver.substeps_of[t]  # pushing out, which is held back as well, gives no more
            step = math.sqrt(each / solver.mass_of[t]) * dt * solver.own[t]
            if taken > 0.5 * solver.energy[t] and step > STRUCK_EXCESS:
                q = 0
                while solver.island[q] != t:
                    q += 1
                note_fault(solver, RESTRAINED, solver.body_row[q])


@part
def solve_substeps(state, dt, arms):
    """Advance the bodies by their substeps under their mean acceleration and their contacts."""
    solver = state.solver
    for k in range(solver.contacts):
        compute_effective_mass(solver, k, arms)
        solver.total[k] = solver.peak[k] = 0.0
    solver.visits, solver.usual = 0, state.substeps
    select_rigid(state, dt, zero_of(state), arms)
    start = begin = 0
    joints, direct = solver.joints, solver.direct
    for s in range(solver.ranges):
        span = start, solver.row_ends[s], begin, solver.body_ends[s]
        special = s > 0
        if special:
            for m in range(solver.movers):
                q = solver.mover[m]
                solver.shift[q] = zero_of(state)
                if len(arms) > 0:
                    rotate_body(solver, q, scale(solver.spin[q], -dt))
        joints.begin, joints.end = joints.end if special else 0, solver.joint_ends[s]
        if joints.active > 0:
            direct.begin, direct.end = direct.end if special else 0, direct.body_ends[s]
        if span[1] > start or joints.begin < joints.end:
            solve_range(solver, s, dt, span, arms)
        start, begin = span[1], span[3]
    count_work(state, dt)


@packed
def solve_contacts(state, dt):
    """The contacts of bodies of which none spins."""
    if state.solver.contacts > 0:
        solve_substeps(state, dt, NO_ARMS)
    return OK


@packed
def solve_turning_contacts(state, dt):
    """The contacts and joints of bodies of which some spin."""
    if state.solver.contacts > 0 or state.solver.joints.active > 0:
        solve_substeps(state, dt, ARMS)
    return OK
