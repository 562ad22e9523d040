"""Pairs that touch in four points, as faces in space do. Worlds in a plane link none of it.

Along their normals two across are solved at once, then the other two, as on two of them what lies flat is in balance,
then what these have left of the first; along their surfaces all at once. Else what stands on them would rock on, and
creep to one side.
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, packed
from ....framework.vectors import add, add_scaled, dot, item, replace, scale, sub
from ...codes import OK
from ...integration.turning import cross_spin, twist
from ..constants import TURNING_FREQUENCY
from .chunks import (
    chunk_motion,
    chunk_of,
    gather_motion,
    parting_at,
    scatter_motion,
    solve_two,
    spun,
    store_motion,
    terms_at,
)  # fmt: skip
from .rows import ARMS, NO_ARMS

SAG_OF_SHARE = 0.25 / (2.0 * math.pi * TURNING_FREQUENCY) ** 2  # kg m/s, of a contact's spring, per N s on four of them


@inlined
def mixed_at(light, one, other):
    """1 / kg that an impulse at one point of a pair moves at another. light: 1 / kg of both bodies; one, other: see
    ``terms_at``."""
    return light * dot(one[0], other[0]) + (dot(one[1], other[3]) + dot(one[2], other[4]))


@inlined
def answers_of_two(one, other, mixed, e, f):
    """The impulses of two points, see ``terms_at``, that stop e and f there; mixed: 1 / kg between them."""
    own, keep, others, keeps = one[5], one[6], other[5], other[6]
    share = 1.0 / (own * others - keep * keeps * mixed * mixed)
    return share * (others * e - keep * mixed * f), share * (own * f - keeps * mixed * e)


@inlined
def combined(a, b, c, d, by):
    """The sum of four vectors times these."""
    x, y, z, w = by
    return add(add(scale(a, x), scale(b, y)), add(scale(c, z), scale(d, w)))


@inlined
def solve_rest(solver, p, stride, motion, bias, softly):
    """The motion after what two of four points, solved last, have left of the other two has been solved so that theirs
    stays as it is: one after the other what stands on a long face would rock on. p: the first row; if all four push,
    then as well."""
    push, k, m, o = solver.impulse, p + stride, p + 2 * stride, p + 3 * stride
    if not ((push[p] > 0.0) & (push[k] > 0.0) & (push[m] > 0.0) & (push[o] > 0.0)):
        return motion
    a, b = terms_at(solver, p, p, motion, bias, softly), terms_at(solver, p, k, motion, bias, softly)
    c, d = terms_at(solver, p, m, motion, bias, softly), terms_at(solver, p, o, motion, bias, softly)
    w_a, w_b, keep, keeps = solver.mass_a[p], solver.mass_b[p], a[6], c[6]
    light = w_a + w_b
    ab, ad, cb, cd = mixed_at(light, a, b), mixed_at(light, a, d), mixed_at(light, c, b), mixed_at(light, c, d)
    ac, bd = mixed_at(light, a, c), mixed_at(light, b, d)
    b_of_a, d_of_a = answers_of_two(b, d, bd, b[6] * ab, d[6] * ad)  # to an impulse of 1 at the first point
    b_of_c, d_of_c = answers_of_two(b, d, bd, b[6] * cb, d[6] * cd)
    on_a, on_c = a[5] - keep * (ab * b_of_a + ad * d_of_a), c[5] - keeps * (cb * b_of_c + cd * d_of_c)
    mixed, other = keep * (ac - ab * b_of_c - ad * d_of_c), keeps * (ac - cb * b_of_a - cd * d_of_a)
    size = on_a * on_a + mixed * mixed + other * other + on_c * on_c  # the two move as one: there is only one such way
    share = 1.0 / size if size > 0.0 else 0.0
    x, z = share * (on_a * a[7] + other * c[7]), share * (mixed * a[7] + on_c * c[7])
    y, w = -(b_of_a * x + b_of_c * z), -(d_of_a * x + d_of_c * z)
    if not ((push[p] + x > 0.0) & (push[k] + y > 0.0) & (push[m] + z > 0.0) & (push[o] + w > 0.0)):
        return motion
    push[p], push[k], push[m], push[o] = push[p] + x, push[k] + y, push[m] + z, push[o] + w
    by, (v_a, s_a, v_b, s_b) = (x, y, z, w), motion
    along = combined(a[0], b[0], c[0], d[0], by)
    s_a, s_b = sub(s_a, combined(a[3], b[3], c[3], d[3], by)), add(s_b, combined(a[4], b[4], c[4], d[4], by))
    return add_scaled(v_a, along, -w_a), s_a, add_scaled(v_b, along, w_b), s_b


@inlined
def area_between(a, b, c, n):
    """Twice the area of a triangle, seen along n; below 0 the other way round."""
    return dot(cross_spin(sub(b, a), sub(c, a)), n)


@inlined
def spread_load(solver, p, stride):
    """Four points of a pair, of which p is the first row, share its load as four equal springs do: their impulses lose
    what adds up to no force and no torque, so that nothing moves otherwise; friction has its limits from them. Where
    one is open by more than a spring sags under its share they stay as they are."""
    rows, n, push, by = (p, p + stride, p + 2 * stride, p + 3 * stride), solver.normal[p], solver.impulse, 1.0
    (a, b, c, d), at, load, more, square = rows, solver.arm_a, 0.0, 0.0, 0.0
    a, b, c, d = at[a], at[b], at[c], at[d]
    weights = area_between(b, c, d, n), -area_between(a, c, d, n), area_between(a, b, d, n), -area_between(a, b, c, n)
    for e in range(4):
        pushed, w = push[rows[e]], weights[e]
        load, more, square = load + pushed, more + w * pushed, square + w * w
    more /= square if square > 0.0 else 1.0
    for e in range(4):
        k, less = rows[e], weights[e] * more
        if less > push[k]:
            by = min(by, push[k] / less)
        if solver.target_speed[k] * solver.mass[k] > SAG_OF_SHARE * load:
            by = 0.0
    for e in range(4):
        push[rows[e]] -= by * more * weights[e]


@inlined
def most_moved(solver, p, n, arm_a, arm_b):
    """1 / kg that an impulse across n at the ends of two arms moves, in the direction in which that is most, of the
    pair whose first row is p."""
    axis = 0 if abs(item(n, 0)) < 0.75 else 1
    one = add_scaled(replace(scale(n, 0.0), axis, 1.0), n, -item(n, axis))
    size = math.sqrt(dot(one, one))
    one = scale(one, 1.0 / size if size > 0.0 else 0.0)
    two = cross_spin(n, one)
    t_a, t_b, u_a, u_b = twist(arm_a, one), twist(arm_b, one), twist(arm_a, two), twist(arm_b, two)
    (x_a, x_b), (y_a, y_b) = spun(solver, p, t_a, t_b), spun(solver, p, u_a, u_b)
    first, second, mixed = dot(t_a, x_a) + dot(t_b, x_b), dot(u_a, y_a) + dot(u_b, y_b), dot(t_a, y_a) + dot(t_b, y_b)
    half = 0.5 * (first - second)
    return solver.mass_a[p] + solver.mass_b[p] + (0.5 * (first + second) + math.sqrt(half * half + mixed * mixed))


@inlined
def twisted_by(one, two, three, four, pulls):
    """The torque of four impulses at the ends of four arms."""
    a, b, c, d = pulls
    return add(add(twist(one, a), twist(two, b)), add(twist(three, c), twist(four, d)))


@inlined
def pulled_at(pull, turn, arm, share, limit):
    """What a point with a share of the load pulls, at an arm from the middle of the loads: no more than friction can.
    pull, turn: what all would pull together, as one force and one turn."""
    here = add(pull, cross_spin(turn, arm))
    square = dot(here, here)
    return scale(here, share * (limit / math.sqrt(square) if square > limit * limit else 1.0))


@inlined
def square_at(pull, turn, arm, push):
    """How much one would pull there, squared, if it pushes."""
    here = add(pull, cross_spin(turn, arm))
    return dot(here, here) if push > 0.0 else 0.0


@inlined
def rub_four(solver, p, stride, motion, runs):
    """(motion, impulses) after the friction of four points of a pair, of which p is the first row. What slides there
    is seen from the middle of their loads as one speed and one turn, and against that all pull at once, each by its
    load: by so much as stops both, or where some would pull more than friction can, so that it is against what slides
    there. Without a branch, so that several pairs are solved together."""
    k, m, o, n = p + stride, p + 2 * stride, p + 3 * stride, solver.normal[p]
    push, at, pulls, (v_a, s_a, v_b, s_b) = solver.impulse, solver.arm_a, solver.tangent, motion
    load = (push[p] + push[k]) + (push[m] + push[o])
    # 1 if no other one pushes: there is no turn. Where none does what they have pulled goes, about their middle.
    whole, even, limit = load if load > 0.0 else 1.0, 0.0 if load > 0.0 else 0.25, solver.friction[p] * load
    shares = push[p] / whole + even, push[k] / whole + even, push[m] / whole + even, push[o] / whole + even
    arm_a = combined(at[p], at[k], at[m], at[o], shares)
    arm_b = combined(solver.arm_b[p], solver.arm_b[k], solver.arm_b[m], solver.arm_b[o], shares)
    a, b, c, d = sub(at[p], arm_a), sub(at[k], arm_a), sub(at[m], arm_a), sub(at[o], arm_a)
    before = pulls[p], pulls[k], pulls[m], pulls[o]
    old = combined(before[0], before[1], before[2], before[3], (1.0, 1.0, 1.0, 1.0))
    torque = twisted_by(a, b, c, d, before)
    inertia = shares[0] * dot(a, a) + shares[1] * dot(b, b) + (shares[2] * dot(c, c) + shares[3] * dot(d, d))
    slip = parting_at(motion, arm_a, arm_b)
    if len(runs) > 0:
        slip = add(slip, solver.surface_slip[p])
    (x_a, x_b), slip, turns = spun(solver, p, n, n), add_scaled(slip, n, -dot(slip, n)), dot(sub(s_b, s_a), n)
    moved, turned = most_moved(solver, p, n, arm_a, arm_b), inertia * (dot(n, x_a) + dot(n, x_b))
    twisted = dot(torque, n)
    bound = max(inertia * limit, abs(twisted) * math.sqrt(inertia))  # loads that move leave less of it
    twisted = twisted * limit / bound if bound > 0.0 else 0.0
    stops, stays = 1.0 / moved, 1.0 / turned if turned > 0.0 else 0.0
    pull, turn = add_scaled(old, slip, -stops), scale(n, twisted - stays * turns)
    most = max(square_at(pull, turn, a, push[p]), square_at(pull, turn, b, push[k]))
    most = max(most, max(square_at(pull, turn, c, push[m]), square_at(pull, turn, d, push[o])))
    slides = most > limit * limit
    by = 1.0 / max(moved, turned)
    stops, stays = by if slides else stops, by if slides else stays
    pull, turn = add_scaled(old, slip, -stops), scale(n, twisted - stays * turns)
    new = (
        pulled_at(pull, turn, a, shares[0], limit), pulled_at(pull, turn, b, shares[1], limit),
        pulled_at(pull, turn, c, shares[2], limit), pulled_at(pull, turn, d, shares[3], limit),
    )  # fmt: skip
    less = sub(combined(new[0], new[1], new[2], new[3], (1.0, 1.0, 1.0, 1.0)), old)
    more = sub(twisted_by(a, b, c, d, new), torque)
    x_a, x_b = spun(solver, p, add(more, twist(arm_a, less)), add(more, twist(arm_b, less)))
    v_a, v_b = add_scaled(v_a, less, -solver.mass_a[p]), add_scaled(v_b, less, solver.mass_b[p])
    return (v_a, sub(s_a, x_a), v_b, add(s_b, x_b)), new


@inlined
def solve_rows_of_four(solver, chunk, bias, softly, layout, runs):
    """The rows of some pairs, see ``solve_fours``; runs: see ``pull_at``."""
    start, pairs, stride = layout
    for e in range(2):
        first, second = start + e * stride, start + (e + 2) * stride
        for q in range(pairs):  # it stores nothing where it reads: else no two pairs would be solved together
            motion, chunk.impulse[q], chunk.other[q] = solve_two(
                solver, start + q, first + q, second + q, chunk_motion(chunk, q), bias, softly
            )
            store_motion(chunk, q, motion)
        for q in range(pairs):
            solver.impulse[first + q], solver.impulse[second + q] = chunk.impulse[q], chunk.other[q]
    for q in range(pairs):
        p = start + q
        store_motion(chunk, q, solve_rest(solver, p, stride, chunk_motion(chunk, q), bias, softly))
        spread_load(solver, p, stride)
    for q in range(pairs):
        motion, pulls = rub_four(solver, start + q, stride, chunk_motion(chunk, q), runs)
        chunk.pull[q], chunk.other_pull[q], chunk.third_pull[q], chunk.fourth_pull[q] = pulls
        store_motion(chunk, q, motion)
    pulls = solver.tangent
    for q in range(pairs):
        k = start + q
        pulls[k], pulls[k + stride] = chunk.pull[q], chunk.other_pull[q]
        pulls[k + 2 * stride], pulls[k + 3 * stride] = chunk.third_pull[q], chunk.fourth_pull[q]


@packed
def solve_fours(solver, pushes, layout):
    """A pass over some pairs of a chunk. pushes: see ``solve_normals``; layout: (row of their first points, how many
    pairs, rows from one of their points to the next)."""
    start, pairs, _ = layout
    chunk = chunk_of(solver)
    bias = solver.pushing if pushes else solver.target_speed
    softly = 1.0 if pushes else 0.0
    gather_motion(solver, chunk, start, pairs)
    if solver.surfaces_run:
        solve_rows_of_four(solver, chunk, bias, softly, layout, ARMS)
    else:
        solve_rows_of_four(solver, chunk, bias, softly, layout, NO_ARMS)
    scatter_motion(solver, chunk, start, pairs)
    return OK
