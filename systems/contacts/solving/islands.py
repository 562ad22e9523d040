"""The order of rows and bodies in a step: islands, how many substeps each has, and colours.

An island is what contacts join, without what cannot be moved; islands do not know of each other. Most have as many
substeps as the settings say: these are one range of rows, sorted by colour. Special ones have more, as their masses
and what strikes them ask for, or are hard: each is a range by itself, behind the others.

Pairs of one colour share no body that moves, so that the processor can work on several at once. Where bodies spin their
rows are chunks: those of the first points of some pairs, then those of the second points of the same.
"""

from __future__ import annotations

import math

from ....framework.compilation import inlined, part
from ....framework.jit.records.record_type import zero_of
from ....framework.jit.stack_arrays import stack_array
from ....framework.vectors import add, dot, length, sub
from ...bits import lowest_bit
from ...codes import OK
from ...integration.turning import arms_to, velocity_by_spin
from ...islands import join_roots, root_of
from ...joints.order import choose_direct
from ...joints.records import LIMIT, TURN
from ...linking.parts import JOINED_ISLANDS, call_of_step
from ...narrow_phase.manifolds import centre_offset_at_start
from ...parts.rows import owner_of, place_of
from ...shapes.tolerances import smaller_extent
from ..constants import (
    FREQUENCY,
    LEAST_WORK_SUBSTEPS,
    LIMIT_STRIKE,
    MOST_SAG,
    MOST_SWAY,
    OWN_SAG,
    STRIKE_SUBSTEPS,
    STRUCK_EXCESS,
    STRUCK_JOINT_SUBSTEPS,
)  # fmt: skip
from ..points import points_of
from .passes import most_repeats
from .records import ROW_CHUNK

COLOURS = 62  # bits of a mask; pairs of a body beyond them share the last one
STARTS = 2 * COLOURS + 2  # where rows of each colour begin, with one point or several
STREAMS = 4  # of joints: more are no faster


@part
def solver_index(state, i):
    """The place of a row among the bodies of the solver, a new one if it has none yet."""
    solver, place, i = state.solver, state.bodies.place, owner_of(state, i)
    if place[i] < 0:
        q = solver.bodies
        place[i] = q
        solver.body_row[q], solver.used[q], solver.island[q], solver.group[q] = i, 0, q, q
        solver.bodies += 1
    return place[i]


@part
def is_ordered(state, listed):
    """Whether rows whose points are ``listed`` as before have the order of the last step, too, which was of one range
    without joints: it follows from their pairs, and which bodies can be moved. Then bodies get the places they had."""
    solver, pairs, bodies, row = state.solver, state.pairs, state.bodies, state.solver.body_row
    same = listed & (solver.ranges == 1) & (solver.row_ends[0] == solver.contacts)
    same &= ((solver.chunks > 0) == state.spinning) & (solver.joint_ends[0] + solver.joints.active == 0)
    for r in range(solver.contacts if same else 0):
        a, b, k = pairs.a[solver.pair[r]], pairs.b[solver.pair[r]], solver.slot[r]
        same &= (row[solver.first[k]] == owner_of(state, a)) & (row[solver.second[k]] == owner_of(state, b))
    for q in range(solver.bodies if same else 0):
        same &= solver.inverse_mass[q] == bodies.inverse_mass[row[q]]
    for q in range(solver.bodies if same else 0):
        bodies.place[row[q]] = q
    return same


@part
def colour_rows(state):
    """Number the bodies of the rows, join them into islands and choose the colours, odd ones of pairs with several
    points."""
    solver, pairs, inverse_mass = state.solver, state.pairs, state.bodies.inverse_mass
    used, island = solver.used, solver.island
    solver.bodies = chosen = 0
    for r in range(solver.contacts):
        if solver.point[r] > 0:
            solver.colour[r] = chosen
            continue
        c, taken = solver.pair[r], 0
        a, b = pairs.a[c], pairs.b[c]
        p, q = solver_index(state, a), solver_index(state, b)
        moves_a, moves_b = inverse_mass[a] > 0.0, inverse_mass[b] > 0.0
        if moves_a:
            taken |= used[p]
        if moves_b:
            taken |= used[q]
        colour = min(lowest_bit(~taken), COLOURS - 1)
        if moves_a:
            used[p] |= 1 << colour
        if moves_b:
            used[q] |= 1 << colour
        if moves_a and moves_b:
            join_roots(island, p, q)
        chosen = 2 * colour + (r + 1 < solver.contacts and solver.point[r + 1] > 0)
        solver.colour[r] = chosen


@part
def join_bodies(state):
    """Number the bodies of joints, which join islands as contacts do, and groups, which contacts do not join."""
    solver, inverse_mass = state.solver, state.bodies.inverse_mass
    joints = solver.joints
    for e in range(joints.active):
        j = joints.order[e]
        a, b = joints.row_a[j], joints.row_b[j]
        p, q = solver_index(state, a) if a >= 0 else -1, solver_index(state, b) if b >= 0 else -1
        if p >= 0 and q >= 0 and inverse_mass[a] > 0.0 and inverse_mass[b] > 0.0:
            join_roots(solver.island, p, q)
            join_roots(solver.group, p, q)


@inlined
def island_of_rows(state, a, b):
    """The island of the bodies of two rows, below 0 for the world."""
    island = state.solver.island
    return max(island[place_of(state, a)] if a >= 0 else -1, island[place_of(state, b)] if b >= 0 else -1)


@part
def measure_joint(state, j, dt):
    """Count a row of joints for its island, and find whether its bodies turn so fast that a limit strikes them."""
    solver, joints, spin = state.solver, state.solver.joints, state.bodies.spin
    a, b = joints.row_a[j], joints.row_b[j]
    t = island_of_rows(state, a, b)
    solver.links[t] += 1
    if joints.rule[j] > LIMIT:  # motors and springs give energy
        solver.credit[t] = math.inf
    if joints.kind[j] >= TURN and joints.rule[j] == LIMIT:
        nothing = zero_of(state)
        turned = sub(spin[b] if b >= 0 else nothing, spin[a] if a >= 0 else nothing)
        if length(turned) * dt > LIMIT_STRIKE:
            solver.substeps_of[t] = STRUCK_JOINT_SUBSTEPS


@part
def number_islands(state, dt, ordered):
    """``island`` becomes the number of each body's island, in the order of their first bodies; -1 for what cannot be
    moved. It is that already if rows are ``ordered``. What is known of its bodies is summed up."""
    solver, bodies, island, count = state.solver, state.bodies, state.solver.island, 0
    velocity, start, warm_started = bodies.linear_velocity, bodies.start_velocity, bodies.warm_started
    number, lightest, most_change = solver.number, solver.lightest, solver.most_change
    for q in range(solver.bodies):
        i = solver.body_row[q]
        w = bodies.inverse_mass[i]
        if w == 0.0:
            number[q] = -1
            continue
        root = q if ordered else root_of(island, q)
        t = island[q] if ordered else (number[root] if root < q else count)
        if t == count:
            count += 1
            lightest[t], most_change[t], solver.mass_of[t], solver.force_of[t] = math.inf, 0.0, 0.0, 0.0
            solver.stiff[t] = solver.own[t] = solver.approach_extents[t] = solver.taken[t] = 0.0
            solver.size_of[t] = solver.substeps_of[t] = 0
            solver.credit[t] = 0.0
            solver.at_once[t], solver.tips[t], solver.sway[t], solver.links[t] = False, False, 0.0, 0
        number[q] = t
        change = sub(velocity[i], start[i])
        if warm_started[i]:
            change = sub(change, bodies.warm_start_velocity[i])
        speed = math.sqrt(dot(change, change))
        lightest[t], most_change[t] = min(lightest[t], w), max(most_change[t], speed)
        solver.mass_of[t] += 1.0 / w
        solver.force_of[t] += speed / w
    solver.islands = count
    for q in range(solver.bodies):
        island[q] = number[q]
    if solver.joints.active > 0:
        call_of_step(state.links[JOINED_ISLANDS], state, dt)


def measure_joined_islands(state, dt):
    """What joints are to their islands."""
    joints = state.solver.joints
    for e in range(joints.active):
        measure_joint(state, joints.order[e], dt)
    choose_direct(state)
    return OK


@part
def measure_islands(state, dt):
    """What each island's rows ask for: how stiff they must be, and how fast they are struck."""
    solver, pairs, bodies, nothing = state.solver, state.pairs, state.bodies, zero_of(state)
    velocity, inverse_mass, size_of, t = bodies.start_velocity, bodies.inverse_mass, solver.size_of, -1
    for r in range(solver.contacts):
        if solver.point[r] > 0:  # asks for nothing else
            size_of[t], solver.tips[t] = size_of[t] + 1, True
            continue
        c = solver.pair[r]
        a, b = pairs.a[c], pairs.b[c]
        t = island_of_rows(state, a, b)
        w_a, w_b, inverse_extent = inverse_mass[a], inverse_mass[b], 1.0 / smaller_extent(bodies, a, b)
        v_a, v_b = velocity[a] if a < state.moving else nothing, velocity[b] if b < state.moving else nothing
        size_of[t] += 1
        stiff = (w_a + w_b) * inverse_extent
        solver.stiff[t], solver.own[t] = max(solver.stiff[t], stiff), max(solver.own[t], stiff / max(w_a, w_b))
        strike = dot(sub(v_a, v_b), pairs.normal[c]) * dt * inverse_extent
        if solver.links[t] > 0:
            arms = arms_to(bodies, a, b, pairs.normal[c], pairs.point[c], centre_offset_at_start(bodies, a, b))
            speed = length(add(sub(v_b, v_a), velocity_by_spin(bodies, a, b, arms)))
            if speed * dt * inverse_extent > LIMIT_STRIKE:
                solver.substeps_of[t] = STRUCK_JOINT_SUBSTEPS
        if strike > solver.approach_extents[t]:
            solver.approach_extents[t] = strike


@inlined
def usual_sag(solver, t, dt):
    """How far a row of island t sags, m, where one substep bears the weight of its lighter body."""
    turn = 2.0 * math.pi * FREQUENCY
    return solver.most_change[t] * dt / (turn * turn)


@inlined
def own_need(solver, t, dt):
    """The square of the substeps that the own weight of bodies of island t asks for."""
    return usual_sag(solver, t, dt) * solver.own[t] / OWN_SAG


@inlined
def is_hard_island(solver, t, usual, dt):
    """Whether that is too many: its contacts are rigid."""
    return own_need(solver, t, dt) > float(usual * usual)


@part
def choose_substeps(solver, t, usual, dt):
    """How many substeps island t has; returns whether it is special.

    Its contacts may have to bear its heaviest body: the sag under that falls with the square of the substeps, the depth
    of an impact with 1 / substeps. Where the own weight of bodies asks for too many, contacts are rigid. Loads beyond
    MOST_REPEATS are capped, see ``load_share``. From masses, not from impulses, which would change with the substeps;
    by factors of two, so that it seldom changes. Light bodies whose joints bear heavy ones swing fast.
    """
    least, sag = usual, usual_sag(solver, t, dt)
    while MOST_SWAY * float(least * least) < sag * solver.sway[t] and 2 * least <= LEAST_WORK_SUBSTEPS:
        least *= 2
    least = max(least, solver.substeps_of[t])
    if solver.size_of[t] == 0:  # it has joints alone
        solver.substeps_of[t], solver.load_share[t] = least, math.inf
        return least > usual or solver.at_once[t]
    hard, stiff = is_hard_island(solver, t, usual, dt), solver.stiff[t]
    own, lightest = solver.own[t], solver.lightest[t]
    need = sag * stiff / (lightest * MOST_SAG)
    if hard:
        need *= OWN_SAG / max(OWN_SAG, own_need(solver, t, dt))
    strike = solver.approach_extents[t] - 2.0 * solver.most_change[t] * own * dt
    ratio = stiff / (lightest * own)
    struck = STRIKE_SUBSTEPS * strike * ratio if strike > STRUCK_EXCESS else 0.0
    most = max(LEAST_WORK_SUBSTEPS, most_repeats(solver.size_of[t] + solver.links[t]))
    asked, substeps = max(need, struck * struck), least
    while float(substeps * substeps) < asked and 2 * substeps <= most:
        substeps *= 2
    solver.substeps_of[t] = substeps
    solver.load_share[t] = float(substeps * substeps) / need if need > 0.0 else math.inf
    return substeps > usual or hard or solver.at_once[t]


@part
def place_rows(state):
    """``slot`` of each row by (range, colour), and the bodies by range: the ordinary islands are range 0."""
    solver, bodies, pairs, starts = state.solver, state.bodies, state.pairs, stack_array(STARTS, 0)
    row, island, number, range_of = solver.body_row, solver.island, solver.number, solver.range_of
    ends, body_ends, count = solver.row_ends, solver.body_ends, solver.bodies
    slot, colour, contacts, listed, ranges = solver.slot, solver.colour, solver.contacts, solver.listed, solver.ranges
    for k in range(2 * COLOURS + 1):
        starts[k] = 0
    for r in range(contacts):
        starts[colour[r] + 1] += 1
    for k in range(1, 2 * COLOURS + 1):
        starts[k] += starts[k - 1]
    for r in range(contacts):
        e = starts[colour[r]]
        starts[colour[r]] += 1
        slot[r], listed[e] = e, r
    ends[0], body_ends[0] = contacts, count
    if ranges == 1:
        return
    for s in range(ranges):
        ends[s] = body_ends[s] = 0
    for r in range(contacts):
        c = solver.pair[r]
        t = island_of_rows(state, pairs.a[c], pairs.b[c])
        slot[r] = range_of[t]
        ends[range_of[t]] += 1
    for q in range(count):
        body_ends[range_of[island[q]] if island[q] >= 0 else 0] += 1
    rows = places = 0
    for s in range(ranges):  # from how many to where each begins
        rows, ends[s] = rows + ends[s], rows
        places, body_ends[s] = places + body_ends[s], places
    for e in range(contacts):
        r = listed[e]
        s = slot[r]
        slot[r] = ends[s]
        ends[s] += 1
    for q in range(count):
        s = range_of[island[q]] if island[q] >= 0 else 0
        number[q] = body_ends[s]
        body_ends[s] += 1
    for q in range(count):
        bodies.place[row[q]] = number[q]
        solver.used[number[q]], solver.mover[number[q]] = row[q], island[q]
    for q in range(count):
        row[q], island[q] = solver.used[q], solver.mover[q]


@part
def build_chunks(state):
    """Divide the rows of each range and colour into chunks, and place those of a chunk point by point."""
    solver = state.solver
    listed, colour, ends = solver.listed, solver.colour, solver.row_ends
    for r in range(solver.contacts):
        listed[solver.slot[r]] = r
    start = s = 0
    while start < solver.contacts:
        while ends[s] <= start:
            s += 1
        chosen = colour[listed[start]]
        points = points_of(state, solver.pair[listed[start]]) if chosen % 2 == 1 else 1
        most = min(ends[s], start + points * (ROW_CHUNK if chosen < 2 * COLOURS - 2 else 1))
        stop = start
        while stop < most and colour[listed[stop]] == chosen:
            stop += points
        pairs = (stop - start) // points
        for q in range(pairs):
            for e in range(points):
                solver.slot[listed[start + q * points + e]] = start + e * pairs + q
        solver.ends[solver.chunks], solver.points[solver.chunks] = stop, points
        solver.chunks += 1
        start = stop


@part
def order_joints(state):
    """The rows of joints by range and island, and the places of their bodies; the world has that behind all bodies.

    The rows of a joint stand together, and its neighbours in a chain apart: they would wait for each other.
    """
    solver, joints, ground = state.solver, state.solver.joints, state.solver.bodies
    island, begins, begin = solver.island, solver.number, 0
    island[ground] = -1
    for s in range(solver.ranges):
        one = 0 if s == 0 else island[solver.body_ends[s - 1]]
        for t in range(one, solver.islands if s == 0 else one + 1):
            if solver.range_of[t] == s:
                begins[t], begin = begin, begin + solver.links[t]
        solver.joint_ends[s] = begin
    for e in range(joints.active):
        j = joints.order[e]
        a, b = joints.row_a[j], joints.row_b[j]
        joints.first[j] = place_of(state, a) if a >= 0 else ground
        joints.second[j] = place_of(state, b) if b >= 0 else ground
        t = max(island[joints.first[j]], island[joints.second[j]])
        joints.open_row[begins[t]], joints.stream[begins[t]] = j, t
        begins[t] += 1
    start = e = 0
    while start < joints.active:
        t, stop, count = joints.stream[start], start, 0
        while stop < joints.active and joints.stream[stop] == t:
            one, stop = stop, stop + 1
            if one == start or joints.joint[joints.open_row[one]] != joints.joint[joints.open_row[one - 1]]:
                joints.stream[start + count] = one  # where a joint begins
                count += 1
        rows = (count + STREAMS - 1) // STREAMS
        for k in range(rows):
            for c in range(start + k, start + count, rows):
                one = joints.stream[c]
                end = joints.stream[c + 1] if c + 1 < start + count else stop
                while one < end:
                    joints.order[e] = joints.open_row[one]
                    one, e = one + 1, e + 1
        start = stop


@part
def order_rows(state, dt, listed):
    """Islands, their substeps, and the order of rows and bodies. listed: see :func:`is_ordered`."""
    solver, ordered = state.solver, is_ordered(state, listed)
    if not ordered:
        colour_rows(state)
        join_bodies(state)
    number_islands(state, dt, ordered)
    measure_islands(state, dt)
    solver.ranges = 1
    for t in range(solver.islands):
        solver.range_of[t] = 0
        if choose_substeps(solver, t, state.substeps, dt):
            s = solver.ranges
            solver.range_of[t], solver.joint_ends[s], solver.ranges = s, 0, s + 1
    if not (ordered and solver.ranges == 1):
        place_rows(state)
        solver.chunks = 0
        if state.spinning:
            build_chunks(state)
        pairs = state.pairs
        for r in range(solver.contacts):
            a, b, k = pairs.a[solver.pair[r]], pairs.b[solver.pair[r]], solver.slot[r]
            solver.first[k], solver.second[k] = place_of(state, a), place_of(state, b)
    solver.joint_ends[0] = 0
