"""Which joints are solved at once, see direct, and the order in which the bodies of their islands go."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import length
from ..contacts.constants import MOST_RATIO
from ..islands import root_of
from ..parts.rows import place_of
from .records import (
    BY_PASSES,
    DRIVE,
    HELD_AT_ONCE,
    HOLD,
    LIMIT,
    LIMITED_AT_ONCE,
    MOST_NEIGHBOURS,
    POINT,
    ROD,
    SERVO,
    TURN,
)

NO_BLOCK = NO_BODY = -1


@inlined
def freedoms(v):
    """Numbers of the motion of a body."""
    return 3 * (len(v) - 1)


@inlined
def is_rigid(joints, j):
    """Whether a row holds its value, whatever force that takes."""
    return joints.rule[j] == HOLD and joints.most[j] == math.inf


@inlined
def numbers_of(joints, j):
    """So many numbers a row holds."""
    return len(joints.normal[j]) if joints.kind[j] == POINT else 1


@part
def measure_group(state, j):
    """What a row of joints is to the group of its bodies, by whose first one that is known."""
    solver, joints, inverse_mass = state.solver, state.solver.joints, state.bodies.inverse_mass
    direct, a, b = solver.direct, joints.row_a[j], joints.row_b[j]
    w_a, w_b = inverse_mass[a] if a >= 0 else 0.0, inverse_mass[b] if b >= 0 else 0.0
    g = root_of(solver.group, place_of(state, a if w_a > 0.0 else b))
    direct.light[g] = max(direct.light[g], max(w_a, w_b))
    direct.heavy[g] = min(direct.heavy[g], w_a if w_a > 0.0 else w_b, w_b if w_b > 0.0 else w_a)
    direct.welds[g] += joints.kind[j] == TURN and joints.rule[j] == HOLD
    if joints.rule[j] in (HOLD, DRIVE, SERVO) and joints.most[j] == math.inf:
        direct.freedom[g] -= 2 * numbers_of(joints, j)
    if joints.kind[j] <= ROD and joints.rule[j] <= LIMIT:
        size = joints.low[j] if joints.rule[j] == HOLD else joints.high[j]
        if joints.kind[j] == POINT:
            reach_a = length(joints.anchor_a[j]) if w_a > 0.0 else 0.0
            size = max(reach_a, length(joints.anchor_b[j]) if w_b > 0.0 else 0.0)
        direct.swing[g] = max(direct.swing[g], (w_a + w_b) / size if size > 0.0 else 0.0)


@part
def choose_direct(state):
    """Joints are solved at once where masses differ much, in beams and frames; from what is joined alone, as another
    way to solve what is stretched would give energy."""
    solver, joints, island = state.solver, state.solver.joints, state.solver.island
    direct, free = solver.direct, 2 * freedoms(zero_of(state)) - 1
    for q in range(solver.bodies if joints.active > 0 else 0):
        direct.light[q], direct.heavy[q], direct.swing[q], direct.welds[q], direct.freedom[q] = 0.0, math.inf, 0.0, 0, 0
    for q in range(solver.bodies if joints.active > 0 else 0):
        direct.freedom[root_of(solver.group, q)] += free
    for e in range(joints.active):
        measure_group(state, joints.order[e])
    for e in range(joints.active):
        j = joints.order[e]
        a = joints.row_a[j]
        q = place_of(state, a if a >= 0 and state.bodies.inverse_mass[a] > 0.0 else joints.row_b[j])
        g, t = root_of(solver.group, q), island[q]
        light, heavy = direct.light[g], direct.heavy[g]
        chosen = light > MOST_RATIO * heavy or direct.welds[g] > 1 or direct.freedom[g] < 0
        joints.at_once[j], joints.group[j] = BY_PASSES, g
        if chosen and is_rigid(joints, j):
            joints.at_once[j] = HELD_AT_ONCE
        elif chosen and joints.rule[j] in (LIMIT, DRIVE, SERVO) and joints.kind[j] != POINT:
            joints.at_once[j] = LIMITED_AT_ONCE
        solver.at_once[t] |= joints.at_once[j] == HELD_AT_ONCE
        solver.sway[t] = max(solver.sway[t], direct.swing[g] / heavy)


@inlined
def block_of(direct, q, p):
    """The block of body q, which goes first, and p; NO_BLOCK if there is none."""
    for k in range(direct.degree[q]):
        if direct.near[q, k] == p:
            return direct.block[q, k]
    return NO_BLOCK


@part
def note_near(direct, q, p, block):
    """Body q has a neighbour more; returns whether there is room for it."""
    k = direct.degree[q]
    if k == MOST_NEIGHBOURS:
        return False
    direct.near[q, k], direct.block[q, k], direct.degree[q] = p, block, k + 1
    return True


@part
def join_pair(direct, q, p):
    """A block for two bodies, unless they have one; returns whether there is room for it."""
    if block_of(direct, q, p) != NO_BLOCK:
        return True
    block = direct.blocks
    direct.blocks += 1
    return note_near(direct, q, p, block) and note_near(direct, p, q, block)


@part
def eliminate_neighbour(direct, q, p):
    """Body q, which goes, is no neighbour of p any more."""
    last = direct.degree[p] - 1
    for k in range(last + 1):
        if direct.near[p, k] == q:
            direct.near[p, k], direct.block[p, k] = direct.near[p, last], direct.block[p, last]
            break
    direct.degree[p] = last


@part
def eliminate(direct, q):
    """Body q goes: its neighbours become neighbours of each other. Returns whether there is room for that."""
    direct.place[q], direct.body[direct.bodies] = direct.bodies, q
    direct.bodies += 1
    for k in range(direct.degree[q]):
        eliminate_neighbour(direct, q, direct.near[q, k])
    for k in range(direct.degree[q]):
        for i in range(k):
            if not join_pair(direct, direct.near[q, i], direct.near[q, k]):
                return False
    return True


@part
def order_island(solver, begin, end, rows_begin, rows_end):
    """The order in which the bodies of a range go, those with few neighbours first; returns a body that would have too
    many, or NO_BODY."""
    joints, direct, island = solver.joints, solver.direct, solver.island
    for q in range(begin, end):
        direct.degree[q] = direct.place[q] = -1
    for e in range(rows_begin, rows_end):
        j = joints.order[e]
        if joints.at_once[j] != BY_PASSES:
            a, b = joints.first[j], joints.second[j]
            for q in (a, b):
                if island[q] >= 0:
                    direct.degree[q] = max(0, direct.degree[q])
            both = island[a] >= 0 and island[b] >= 0 and joints.at_once[j] == HELD_AT_ONCE
            if both and not join_pair(direct, a, b):
                return a
    for least in range(MOST_NEIGHBOURS + 1):
        for one in range(begin, end):
            q = one
            while q >= 0 and direct.place[q] < 0 and 0 <= direct.degree[q] <= least:
                if not eliminate(direct, q):
                    return q
                following = -1
                for k in range(direct.degree[q]):  # chains go on from their ends
                    if direct.degree[direct.near[q, k]] <= least:
                        following = direct.near[q, k]
                q = following
    return NO_BODY


@part
def solve_group_by_passes(solver, q, rows_begin, rows_end):
    """The joints of the group of body q are solved by passes."""
    joints, group = solver.joints, -1
    for e in range(rows_begin, rows_end):
        j = joints.order[e]
        if joints.at_once[j] != BY_PASSES and (joints.first[j] == q or joints.second[j] == q):
            group = joints.group[j]
    for e in range(rows_begin, rows_end):
        if joints.group[joints.order[e]] == group:
            joints.at_once[joints.order[e]] = BY_PASSES


@part
def order_direct(solver):
    """The order of the bodies of all islands with joints that are solved at once; by passes, where a body has
    too many neighbours."""
    direct, begin, rows_begin = solver.direct, 0, 0
    direct.bodies = direct.blocks = 0
    for s in range(solver.ranges):
        end, rows_end, first, blocks = solver.body_ends[s], solver.joint_ends[s], direct.bodies, direct.blocks
        while s > 0 and solver.at_once[solver.island[begin]]:
            full = order_island(solver, begin, end, rows_begin, rows_end)
            if full == NO_BODY:
                break
            direct.bodies, direct.blocks = first, blocks
            solve_group_by_passes(solver, full, rows_begin, rows_end)
        direct.body_ends[s], begin, rows_begin = direct.bodies, end, rows_end
