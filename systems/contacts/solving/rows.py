"""Rows of the solver: points where two bodies touch. How a row moves its bodies stands here, and in
``chunks`` for many at once.

Where bodies spin, each row has an arm to each of its bodies. ``arms`` is ARMS or NO_ARMS, which differ in type: each
part is compiled as if there were no other, and a world without rotation pays nothing for it.

A range of rows is a span (first row, end of the rows, first body, end of the bodies). ``arms`` is an argument by itself
wherever it is asked for: then what is not meant is not even compiled.
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, part
from ....framework.vectors import absolute, add, add_scaled, components, divided, dot, item, replace, scale, sub
from ...integration.turning import (
    SERIES,
    change_of_spin,
    compliance,
    cross_spin,
    end_of_turn,
    mixed_compliance,
    shares_of_small_turn,
    shares_of_turn,
    twist,
)  # fmt: skip
from ..constants import NEGLIGIBLE, STRUCK_EXCESS, UNREACHED

NO_ARMS, ARMS = (), (True,)


@inlined
def compliance_along(solver, k, along, arms):
    """1 / kg that an impulse at row k moves in a direction."""
    a, b = solver.first[k], solver.second[k]
    moved = solver.inverse_mass[a] + solver.inverse_mass[b]
    if len(arms) > 0:
        moved += compliance(solver, a, solver.arm_a[k], along) + compliance(solver, b, solver.arm_b[k], along)
    return moved


@inlined
def rotate_body(solver, q, turn):
    """Body q is turned so far since the step began."""
    solver.turn[q] = turn
    solver.sine[q], solver.versine[q] = shares_of_turn(turn)


@part
def integrate_rotation(solver, begin, end, h):
    """Bodies go on turning for a time; several at once where none has turned far."""
    turns, any_far = solver.turn, False
    for q in range(begin, end):
        turn = add_scaled(turns[q], solver.spin[q], h)
        turns[q] = turn
        solver.sine[q], solver.versine[q] = shares_of_small_turn(turn)
        any_far |= not dot(turn, turn) < SERIES
    for q in range(begin, end if any_far else begin):
        rotate_body(solver, q, turns[q])


@inlined
def turned(solver, q, arm):
    """By how much body q moves the end of an arm as it turns from where the step ends to where it is now."""
    return end_of_turn(solver.turn[q], (solver.sine[q], solver.versine[q]), arm)


@inlined
def separation_from_rotation(solver, k, arms):
    """How much farther apart row k is along its normal because its bodies are not turned as where the step ends."""
    if len(arms) == 0:
        return 0.0
    one, other = turned(solver, solver.first[k], solver.core_a[k]), turned(solver, solver.second[k], solver.core_b[k])
    return dot(sub(other, one), solver.normal[k])


@inlined
def separation(solver, k, arms):
    """The gap of row k where its bodies are now."""
    way = sub(solver.shift[solver.second[k]], solver.shift[solver.first[k]])
    return solver.gap[k] + dot(way, solver.normal[k]) + separation_from_rotation(solver, k, arms)


@inlined
def most_compliance(solver, k, arms):
    """1 / kg that an impulse along the surface at row k moves, in the direction in which that is most."""
    n = solver.normal[k]
    axis = 0 if abs(item(n, 0)) < 0.75 else 1
    one = add_scaled(replace(scale(n, 0.0), axis, 1.0), n, -item(n, axis))
    one = divided(one, math.sqrt(dot(one, one)))
    along = compliance_along(solver, k, one, arms)
    if len(n) == 2:
        return along
    two = cross_spin(n, one)
    across, a, b = compliance_along(solver, k, two, arms), solver.first[k], solver.second[k]
    mixed = mixed_compliance(solver, a, solver.arm_a[k], one, two)
    mixed += mixed_compliance(solver, b, solver.arm_b[k], one, two)
    half = 0.5 * (along - across)
    return 0.5 * (along + across) + math.sqrt(half * half + mixed * mixed)


@inlined
def compute_effective_mass(solver, k, arms):
    """The masses that row k moves along its normal and its surface."""
    solver.mass[k] = 1.0 / compliance_along(solver, k, solver.normal[k], arms)
    if len(arms) > 0:
        solver.tangent_mass[k] = 1.0 / most_compliance(solver, k, arms)


@part
def turn_arms(solver, by, span, arms):
    """Arms to what rolls about another point than its middle turn with it; by: 1, or -1 to go back."""
    middle = solver.middle
    for k in range(span[0], span[1] if solver.lopsided else span[0]):
        a, b = solver.first[k], solver.second[k]
        if dot(middle[a], middle[a]) + dot(middle[b], middle[b]) > 0.0:
            solver.arm_a[k] = add_scaled(solver.arm_a[k], turned(solver, a, middle[a]), by)
            solver.arm_b[k] = add_scaled(solver.arm_b[k], turned(solver, b, middle[b]), by)
            compute_effective_mass(solver, k, arms)


@part
def look_ahead(solver, ahead, span):
    """The velocity of what rolls so becomes what its middle will have after a time: half a substep, as it moves by
    that. Else it would lose energy as it rolls. Each middle moves about its mass centre by the spin before contacts."""
    for q in range(span[2], span[3] if solver.lopsided else span[2]):
        middle, spin = solver.middle[q], solver.spin_before[q]
        if dot(middle, middle) > 0.0:
            inwards = cross_spin(spin, cross_spin(spin, add(middle, turned(solver, q, middle))))
            solver.velocity[q] = add_scaled(solver.velocity[q], inwards, ahead)


@inlined
def velocity_at(solver, q, arm, k, arms):
    """The velocity of body q at the point of row k. arm: the column of arms to that body."""
    v = solver.velocity[q]
    if len(arms) > 0:
        v = add(v, cross_spin(solver.spin[q], arm[k]))
    return v


@inlined
def relative_velocity(solver, k, arms):
    """The velocity of the second body of row k at its point, as the first one sees it there."""
    first = velocity_at(solver, solver.first[k], solver.arm_a, k, arms)
    return sub(velocity_at(solver, solver.second[k], solver.arm_b, k, arms), first)


@inlined
def closing_speed(solver, k, arms):
    """The speed at which the points of row k approach each other along its normal."""
    return -dot(relative_velocity(solver, k, arms), solver.normal[k])


@inlined
def excess_of(closing, opening, impulse):
    """The speed that a pass would still change: what closes too fast, and what an impulse sends apart."""
    excess = closing - opening
    apart = -excess if impulse > 0.0 else 0.0  # without a branch, which would be as good as random
    return excess if excess > apart else apart


@inlined
def excess_speed(solver, k, arms):
    """The speed that a pass over row k would still change."""
    return excess_of(closing_speed(solver, k, arms), solver.target_speed[k], solver.impulse[k])


@inlined
def update_targets(solver, k, room, closing, ahead, dt):
    """What row k asks, which has so much ``room`` and closes so fast, see ``measure``; returns whether its speed is far
    from that. ahead: s in which it may close. Without a branch or a flag, so that several are updated at once."""
    impulse, extent, least, peak = solver.impulse[k], solver.extent[k], solver.most_push[k], solver.peak[k]
    opening = (room if room > 0.0 else 0.0) / ahead
    push = solver.push_rate[k] * room
    push = push if push > least else least
    solver.target_speed[k] = opening
    solver.soft[k] = math.copysign(solver.soft[k], NEGLIGIBLE * extent - room)
    solver.pushing[k] = opening if room > NEGLIGIBLE * extent else push
    solver.peak[k] = impulse if impulse > peak else peak
    return excess_of(closing, opening, impulse) * dt > STRUCK_EXCESS * extent


@part
def leave_open_rows(solver, h, span, arms):
    """What was open when the step began, and has pushed nothing in it, is left to the next one when it ends: by then
    what slides may have passed that corner."""
    extent = solver.extent
    for k in range(span[0], span[1]):
        least = 0.0 if solver.hard[k] and solver.apart[k] else STRUCK_EXCESS
        was_open = solver.peak[k] == 0.0 and solver.gap[k] > least * extent[k]
        if was_open and separation(solver, k, arms) > -NEGLIGIBLE * extent[k]:
            solver.target_speed[k] = UNREACHED * extent[k] / h


@inlined
def apply_impulse(solver, k, impulse, arms):
    """Push the second body of row k by an impulse, a vector, and the first one back."""
    velocity, spin, inverse_mass = solver.velocity, solver.spin, solver.inverse_mass
    a, b = solver.first[k], solver.second[k]
    v_a, v_b, w_a, w_b = velocity[a], velocity[b], inverse_mass[a], inverse_mass[b]
    if w_a > 0.0:  # storing what stays as it is would make rows with one floor wait for each other
        velocity[a] = add_scaled(v_a, impulse, -w_a)
        if len(arms) > 0:
            spin[a] = sub(spin[a], change_of_spin(solver, a, twist(solver.arm_a[k], impulse)))
    if w_b > 0.0:
        velocity[b] = add_scaled(v_b, impulse, w_b)
        if len(arms) > 0:
            spin[b] = add(spin[b], change_of_spin(solver, b, twist(solver.arm_b[k], impulse)))


@inlined
def solve_normal_of(solver, k, bias, pushes, arms):
    """One row along its normal, see ``solve_normals``."""
    old = solver.impulse[k]
    excess = solver.mass[k] * (closing_speed(solver, k, arms) - bias[k])
    if pushes:
        excess -= max(0.0, solver.soft[k]) * (excess + old)
    new = max(0.0, old + excess)
    apply_impulse(solver, k, scale(solver.normal[k], new - old), arms)
    solver.impulse[k] = new


@part
def solve_normals(solver, bias, pushes, span, arms):
    """One pass over the rows of a range, along their normals, where nothing spins.

    bias: speed at which each row may close, below 0 at which it is to open; softly where this pass ``pushes``.
    """
    for k in range(span[0], span[1]):
        solve_normal_of(solver, k, bias, pushes, arms)


@inlined
def pull_along_surface(old, slip, normal, mass, limit):
    """The impulse along the surface that stops a slip, of at most ``limit``, where it is ``old`` so far."""
    if len(normal) == 2:  # a number along the one direction there is
        along = replace(replace(normal, 0, -item(normal, 1)), 1, item(normal, 0))
        pull = dot(old, along) - mass * dot(slip, along)
        pull = pull if pull < limit else limit
        return scale(along, pull if pull > -limit else -limit)
    pull = add_scaled(old, add_scaled(slip, normal, -dot(slip, normal)), -mass)
    square = dot(pull, pull)
    return scale(pull, limit / math.sqrt(square) if square > limit * limit else 1.0)


@inlined
def solve_friction_of(solver, k, over, arms, runs):
    """Stop what slides at row k, with at most ``friction`` times the normal impulse (Coulomb). over: times the impulse
    that stops it; see FRICTION_OVERRELAXATION. runs: whether some surface does."""
    old, slip = solver.tangent[k], relative_velocity(solver, k, arms)
    if runs:
        slip = add(slip, solver.surface_slip[k])
    mass = over * (solver.tangent_mass[k] if len(arms) > 0 else solver.mass[k])
    pull = pull_along_surface(old, slip, solver.normal[k], mass, solver.friction[k] * solver.impulse[k])
    solver.tangent[k] = pull
    apply_impulse(solver, k, sub(pull, old), arms)


@part
def solve_friction(solver, over, span, arms):
    """One pass along their surfaces, where nothing spins."""
    runs = solver.surfaces_run
    for k in range(span[0], span[1]):
        if solver.friction[k] != 0.0:
            solve_friction_of(solver, k, over, arms, runs)


@inlined
def most_turned(solver, q):
    """An inverse inertia no less than that of body q about any axis; the same in a plane and of what is round."""
    d = solver.inverse_inertia[q]
    if len(d) == 2:
        return item(d, 0)
    (xx, yy, zz), (xy, xz, yz) = components(d), components(absolute(solver.inverse_products[q]))
    return max(xx + xy + xz, yy + xy + yz, zz + xz + yz)


@part
def solve_rolling(solver, span):
    """Stop what rolls on each other, with a torque of at most ``rolling`` times the normal impulse, from one substep
    alone."""
    spins = solver.spin
    for k in range(span[0], span[1]):
        limit, old = solver.rolling[k] * solver.impulse[k], solver.rolled[k]
        if limit > 0.0 or dot(old, old) > 0.0:
            a, b = solver.first[k], solver.second[k]
            light = most_turned(solver, a) + most_turned(solver, b)
            turn = add_scaled(old, sub(spins[b], spins[a]), -1.0 / light) if light > 0.0 else old
            strength = math.sqrt(dot(turn, turn))
            if strength > limit:
                turn = scale(turn, limit / strength)
            solver.rolled[k] = turn
            spins[a] = sub(spins[a], change_of_spin(solver, a, sub(turn, old)))
            spins[b] = add(spins[b], change_of_spin(solver, b, sub(turn, old)))


@part
def relax_row(solver, k, arms):
    """Solve row k, which may close as fast as what is open lets it, and its friction."""
    solve_normal_of(solver, k, solver.target_speed, False, arms)
    if solver.friction[k] != 0.0:
        solve_friction_of(solver, k, 1.0, arms, solver.surfaces_run)
