"""The stages of NARROW: candidates in canonical order, layers, the shapes' functions, and which pairs touch."""

from __future__ import annotations

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.schedule.stages import Rows
from ...framework.vectors import add, dot, length, sub
from ..ccd.search_bounds import has_sweeps
from ..codes import OK, RUN_BROAD
from ..integration.turning import size_of_turn
from ..records import HALVES, PAIR_COLUMNS, SORTED
from ..shapes.dispatch import evaluate, evaluate_batch
from ..shapes.linking.batches import centres_apart
from ..shapes.tolerances import contact_margin
from .manifolds import is_near_manifold, mark_early

# Candidates are sorted by comparison if there are so many times more bodies, else by counting.
BODIES_PER_CANDIDATE = 64
FAST_TURN = 1.0  # rad in a step


@part
def rank_rows(state):
    """The place of each row in the order of entity ids, which ascend in each of four runs: how many ids of its own run
    and of the others are smaller."""
    entity, rank = state.bodies.entity, state.bodies.rank
    stops = state.sleepers, state.dynamic, state.moving, state.count  # of sleepers, dynamic, kinematic, static rows
    start = 0
    for run in range(4):
        stop, first = stops[run], 0
        for i in range(start, stop):
            rank[i] = i - start
        for other in range(4):
            last, k = stops[other], first
            for i in range(start, stop if other != run and first < last else start):
                while k < last and entity[k] < entity[i]:
                    k += 1
                rank[i] += k - first
            first = last
        start = stop
    state.ranks_version = state.version


ROOM_FOR_ORDER = (
    Rows("candidates", HALVES, lambda s: s.candidates.count),
    Rows("candidates", SORTED, lambda s: s.candidates.count),
    Rows("candidates", ("starts",), lambda s: s.count + 1),
    Rows("candidates", ("bucket_starts",), lambda s: s.shapes.count * s.shapes.count + 2),
)  # fmt: skip
ROOM_FOR_PAIRS = (Rows("pairs", PAIR_COLUMNS, lambda s: s.candidates.count),)


def order_candidates(state, dt):
    """Candidates by the smaller entity id, then by the larger, the row of the smaller id first."""
    count = state.candidates.count
    if not state.candidates_ready:
        return RUN_BROAD
    state.candidates_counted += count
    if BODIES_PER_CANDIDATE * count < state.count:
        sort_few(state)
    else:
        sort_by_counting(state)
    return OK


@part
def sort_by_counting(state):
    """Two stable counting sorts, by the larger id and by the smaller."""
    if state.ranks_version != state.version:
        rank_rows(state)
    candidates, rank, count = state.candidates, state.bodies.rank, state.candidates.count
    first, second, starts = candidates.first, candidates.second, candidates.starts
    stop = state.count + 1
    half_a, half_b = candidates.half_a, candidates.half_b
    for i in range(stop):
        starts[i] = 0
    for c in range(count):
        starts[max(rank[first[c]], rank[second[c]]) + 1] += 1
    for i in range(1, stop):
        starts[i] += starts[i - 1]
    for c in range(count):
        a, b = first[c], second[c]
        if rank[a] > rank[b]:
            a, b = b, a
        k = starts[rank[b]]
        starts[rank[b]] += 1
        half_a[k], half_b[k] = a, b
    for i in range(stop):
        starts[i] = 0
    for c in range(count):
        starts[rank[half_a[c]] + 1] += 1
    for i in range(1, stop):
        starts[i] += starts[i - 1]
    for c in range(count):
        k = starts[rank[half_a[c]]]
        starts[rank[half_a[c]]] += 1
        candidates.sorted_a[k], candidates.sorted_b[k] = half_a[c], half_b[c]


@part
def sort_few(state):
    """Merge runs of candidates that are in order into longer ones, until it is one."""
    candidates, entity, count, run = state.candidates, state.bodies.entity, state.candidates.count, 1
    sorted_a, sorted_b, half_a, half_b = candidates.sorted_a, candidates.sorted_b, candidates.half_a, candidates.half_b
    for c in range(count):
        a, b = candidates.first[c], candidates.second[c]
        sorted_a[c], sorted_b[c] = (b, a) if entity[a] > entity[b] else (a, b)
    while run < count:
        for c in range(count):
            half_a[c], half_b[c] = sorted_a[c], sorted_b[c]
        for start in range(0, count, 2 * run):
            middle, stop = min(start + run, count), min(start + 2 * run, count)
            i, j = start, middle
            for k in range(start, stop):
                later = i == middle
                if i < middle and j < stop:
                    one, other = entity[half_a[i]], entity[half_a[j]]
                    later = other < one or (other == one and entity[half_b[j]] < entity[half_b[i]])
                at = j if later else i
                sorted_a[k], sorted_b[k] = half_a[at], half_b[at]
                i, j = i + (not later), j + later
        run *= 2


@inlined
def layers_meet(state, a, b):
    """Whether each one's layer is in the other's mask, and they are not of one group."""
    colliders, slot = state.colliders, state.bodies.collider_slot
    layer, mask, group = colliders.layer, colliders.mask, colliders.group
    accepted = layer[slot[a], a] & mask[slot[b], b] != 0 and layer[slot[b], b] & mask[slot[a], a] != 0
    return accepted and (group[slot[a], a] == 0 or group[slot[a], a] != group[slot[b], b])


@inlined
def is_solid_pair(state, a, b):
    """Whether the two push each other: neither is a sensor, and one can be moved."""
    sensor, bodies = state.colliders.sensor, state.bodies
    slot, inverse_mass = bodies.collider_slot, bodies.inverse_mass
    passive = sensor[slot[a], a] or sensor[slot[b], b]
    return not passive and inverse_mass[a] + inverse_mass[b] > 0.0


@part
def flag_fast_bodies(state, dt, struck):
    """Note the body that moves farthest beyond its own extent and that of the thinnest: where it is not swept, the two
    may have passed through each other. Once before the impacts, and once with their speeds: what is ``struck`` meets
    others unseen until the next step, which takes it to be on the side where its centre is.
    """
    bodies, farthest, thinnest = state.bodies, 0.0, min(state.thinnest_static, state.thinnest_moving)
    for i in range(state.first, state.moving if state.moved else 0):
        v, room = bodies.start_velocity[i], bodies.min_extent[i] + thinnest
        room *= 0.5 if struck and bodies.impact_count[i] > 0 else 1.0
        beyond = dot(v, v) * (dt * dt) - room * room
        if beyond > farthest and bodies.shape[i] >= 0 and not has_sweeps(state, i):
            farthest, state.too_fast_for_discrete, state.too_fast_row = beyond, True, i


@part
def find_fast_turns(state):
    """Note a body that turns farther in a step than contacts can follow where no pair is swept: rows stand for one
    moment of it."""
    bodies = state.bodies
    for i in range(state.first, state.moving):
        if bodies.rolling_radius[i] == 0.0 and size_of_turn(bodies.turn[i]) > FAST_TURN and not has_sweeps(state, i):
            state.turns_too_far = i + 1


def select_pairs(state, dt):
    """The candidates whose layers and groups let them meet become pairs, counted by the shapes of the two bodies."""
    candidates, pairs, bodies, shapes = state.candidates, state.pairs, state.bodies, state.shapes.count
    velocity, start = bodies.linear_velocity, bodies.start_velocity
    changed = state.moved and (state.limits_speed or not state.drifted)
    for i in range(state.first, state.moving):  # that of static bodies is always 0
        bodies.force_speed_change[i] = length(sub(velocity[i], start[i])) if changed else 0.0
    state.too_fast_for_discrete, state.turns_too_far = False, 0
    flag_fast_bodies(state, dt, False)
    if state.spinning:
        find_fast_turns(state)
    shape, kind, starts = bodies.shape, candidates.kind, candidates.bucket_starts
    for k in range(shapes * shapes + 2):
        starts[k] = 0
    several, kept = shapes > 1, 0
    for c in range(candidates.count):
        a, b = candidates.sorted_a[c], candidates.sorted_b[c]
        if layers_meet(state, a, b):
            pairs.a[kept], pairs.b[kept] = a, b
            pairs.is_solid[kept], pairs.early[kept], pairs.disabled[kept] = is_solid_pair(state, a, b), False, False
            if several:
                one, other = min(shape[a], shape[b]), max(shape[a], shape[b])
                kind[kept] = one * shapes + other
                starts[kind[kept] + 2] += 1
            kept += 1
    if not several:
        starts[2] = kept
    pairs.count, pairs.found, state.found_at_end = kept, 0, False
    pairs.resting_count, pairs.disabled_count = 0, 0
    return OK


def evaluate_pairs(state, dt):
    """Every pair by the linked function of its two shapes, in batches of one kind each."""
    candidates, count, shapes = state.candidates, state.pairs.count, state.shapes.count
    if state.several_levels or count == 0:
        return OK
    mark_early(state)
    starts, bucket, kind = candidates.bucket_starts, candidates.bucket, candidates.kind
    only = kind[0] if shapes > 1 else 0
    if starts[only + 2] == count:  # they need no sorting
        for c in range(count):
            bucket[c] = c
        evaluate_batch(state, only, 0, count)
        return OK
    kinds = shapes * shapes
    for k in range(2, kinds + 2):
        starts[k] += starts[k - 1]
    for c in range(count):  # afterwards starts[kind] is where a kind begins
        k = kind[c] + 1
        bucket[starts[k]] = c
        starts[k] += 1
    for k in range(kinds):
        if starts[k] < starts[k + 1]:
            evaluate_batch(state, k, starts[k], starts[k + 1])
    return OK


@part
def evaluate_levels_of(state, a, b, position, loose, margin):
    """(dropped, hit, depth, normal, point) of two bodies; the last level gives the contact, a pair hits if all do.

    position: where bodies are; loose: a rotated level reaches out of another. dropped: out of one that misses, so that
    the two are kept apart in this step.
    """
    levels, offsets = state.bodies.levels, state.bodies.level_offsets
    hit, depth, normal, point = False, 0.0, zero_of(state), zero_of(state)
    missed, first_hit = 0.0, False  # depth of the level that keeps them apart
    last = state.level_count - 1
    for level in range(last + 1):
        shape_a, shape_b = levels[level, a], levels[level, b]
        d = sub(add(position[b], offsets[level, b]), add(position[a], offsets[level, a]))
        hit, depth, normal, point = evaluate(state, shape_a, a, shape_b, b, d)
        if level == last or (shape_a == levels[last, a] and shape_b == levels[last, b]):
            break
        if level == 0:
            state.first_level_tests += 1
            first_hit = hit
            state.first_level_hits += 1 if hit else 0
        if not hit:
            missed = min(missed, depth)
            if depth < -margin and not loose:
                break
    dropped = loose and missed < 0.0 and depth > missed
    hit = hit and not missed < 0.0
    if first_hit and (dropped or not hit):
        state.false_positives += 1
    return dropped, hit, depth, normal, point


def evaluate_levels(state, dt):
    """Every pair level by level; pairs that a rotated level keeps apart are dropped."""
    pairs, bodies = state.pairs, state.bodies
    if not state.several_levels:
        return OK
    mark_early(state)
    span, kept = dt if state.moved else 0.0, 0
    for c in range(pairs.count):
        a, b, solid = pairs.a[c], pairs.b[c], pairs.is_solid[c]
        margin = contact_margin(state, span, a, b) if span > 0.0 and solid else 0.0
        loose = bodies.level_not_enclosing[a] or bodies.level_not_enclosing[b]
        pairs.early[kept] = early = pairs.early[c] and not loose
        position = bodies.previous_position if early else bodies.position
        dropped, hit, depth, normal, point = evaluate_levels_of(state, a, b, position, loose, margin)
        pairs.a[kept], pairs.b[kept], pairs.is_solid[kept] = a, b, solid
        pairs.hit[kept], pairs.depth[kept] = hit, depth
        pairs.at[kept], pairs.normal[kept], pairs.point[kept] = centres_apart(state, kept, a, b), normal, point
        kept += 0 if dropped else 1
    pairs.count = kept
    return OK


def collect_contacts(state, dt):
    """The pairs that touch at the end of their motion, or nearly do, or rested in the step before."""
    pairs = state.pairs
    span, found = dt if state.moved else 0.0, 0
    for c in range(pairs.count):
        hit = pairs.hit[c]
        near = hit or pairs.early[c] or is_near_manifold(state, span, c)
        pairs.near_contact[c] = near
        if hit or (near and span > 0.0):
            pairs.hits[found] = c
            found += 1
    pairs.found = found
    state.pairs_counted += pairs.count
    state.contacts_ready = state.found_current = True
    state.contacts_version += 1
    return OK
