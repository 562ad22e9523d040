"""The stages of BROAD that find candidate pairs: bodies whose boxes overlap, at least one of them moving.

Sleepers count as
static. ``choose_search`` decides by the numbers of moving and static bodies; of the others each does its share:

    moving                       static                        index
    less than UNIFORM_GRID_MIN   no more than BRUTE_FORCE_MAX  brute force
    more                         no more than move             uniform grid of what moves; static bodies look into it
    any number                   more                          static grid, into which what moves looks; static bodies
                                                               that are not in it, and what moves, as above

Where boxes differ too much in size for a grid, or crowd in one place, trees are used: Python builds these
(FIND_IN_PYTHON).
"""

from __future__ import annotations

from ...framework.compilation import packed, part
from ..codes import FIND_IN_PYTHON, NEED_CANDIDATES, NEED_CELLS, OK
from .boxes import FRAME_SIZE, fixed_count, fixed_row
from .brute_force import BRUTE_FORCE_MAX, boxes_overlap
from .static_grid import build_static_grid, follow_rows
from .uniform_grid import FULL, build_grid, look_around, look_inside, look_near, test_notes

# 8 million candidates: with everything that is kept of a pair about 4 gigabytes. A game has 1 to 50 per body.
CANDIDATE_LIMIT = 1 << 23

# Moving bodies from which a uniform grid is tried. It is faster from about 32 on (190 bodies: 2 us against 25), but a
# scene of few bodies starts sooner if its kernels need not be compiled.
UNIFORM_GRID_MIN = BRUTE_FORCE_MAX + 1

BLOCK = 64  # boxes that are ruled out together

# Values of ``state.pair_search``: what finds the candidates of this step.
NO_SEARCH, BRUTE_FORCE, UNIFORM_GRID, STATIC_GRID, TREE, PLUGIN = range(6)


@part
def choose_by_count(moving, static):
    """The search for so many bodies."""
    if static > max(moving, BRUTE_FORCE_MAX):
        return STATIC_GRID
    return UNIFORM_GRID if moving >= UNIFORM_GRID_MIN else BRUTE_FORCE


def choose_search(state, dt):
    """No candidates yet; and how they are to be found."""
    state.candidates.count = 0
    state.pair_search = NO_SEARCH
    if not state.collides or state.all_still:
        return OK
    if state.uses_plugin_broad_phase:
        state.pair_search = PLUGIN
        return FIND_IN_PYTHON
    state.pair_search = choose_by_count(state.moving - state.first, fixed_count(state))
    return OK


@part
def leave_to_trees(state):
    """No grid suits, or there are more pairs than allowed: the tree counts them. The stages that follow do nothing."""
    state.candidates.count = 0
    state.pair_search = TREE
    return FIND_IN_PYTHON


@part
def need_more_room(state):
    """Twice the room for candidates, while that is allowed."""
    room = len(state.candidates.first)
    if room >= CANDIDATE_LIMIT:
        return leave_to_trees(state)
    state.needed = min(2 * max(room, BRUTE_FORCE_MAX), CANDIDATE_LIMIT)
    return NEED_CANDIDATES


def place_statics(state, dt):
    """Where more bodies are static than move: their grid, when they have changed."""
    grid = state.static_grid
    if state.pair_search != STATIC_GRID:
        return OK
    if grid.version != state.statics_version:
        if len(grid.keys) < fixed_count(state):
            state.needed = fixed_count(state)
            return NEED_CELLS
        build_static_grid(state)
    elif grid.first != state.moving:
        follow_rows(state)
    return OK if grid.suits else leave_to_trees(state)


@part
def look_from_outside(state, found):
    """Static bodies that are in no grid look into that of what moves; returns the number of pairs, or FULL."""
    static_grid, all_static = state.static_grid, state.pair_search == UNIFORM_GRID
    for k in range(fixed_count(state) if all_static else static_grid.outside_count):
        i = fixed_row(state, k) if all_static else static_grid.outside[k]
        found = look_inside(state, state.grid, i, state.bodies.lower[i], state.bodies.upper[i], found)
        if found == FULL:
            break
    return found


@part
def do_without_grid(state):
    """The boxes of what moves are too uneven: trees of many, and every pair of few."""
    if state.moving - state.first > BRUTE_FORCE_MAX:
        return leave_to_trees(state)
    if state.pair_search == UNIFORM_GRID:
        state.pair_search = BRUTE_FORCE
    return OK


@part
def use_uniform_grid(state):
    """A uniform grid of what moves, for its pairs and those with static bodies that are in no grid; returns a code."""
    moving, grid, bodies = state.moving - state.first, state.grid, state.bodies
    if len(grid.keys) < moving:
        state.needed = moving
        return NEED_CELLS
    for k in range(FRAME_SIZE):
        grid.frame[k] = state.frame[k]
    build_grid(grid, bodies.lower, bodies.upper, state.first, moving)
    if not grid.suits:
        return do_without_grid(state)
    at, found, count = 0, 0, grid.directory[grid.total]  # without invalid boxes
    while at < count and found != FULL:
        held, at = look_around(grid, at, count)
        found = test_notes(state, held, found)
    if found != FULL:
        found = look_from_outside(state, found)
    if found == FULL:
        return need_more_room(state)
    state.candidates.count = found
    return OK


@packed
def search_uniform_grid(state, dt):
    """Many bodies move."""
    if state.moving - state.first < UNIFORM_GRID_MIN:
        return OK
    if state.pair_search != UNIFORM_GRID and state.pair_search != STATIC_GRID:
        return OK
    return use_uniform_grid(state)


@part
def test_row(state, i, start, stop, found):
    """Pairs of body i and rows start..stop-1; returns the number of pairs, or FULL."""
    lower, upper, candidates = state.bodies.lower, state.bodies.upper, state.candidates
    first, second, low, high = candidates.first, candidates.second, lower[i], upper[i]
    if found + (stop - start) > len(first):
        return FULL
    for k in range(start, stop):
        first[found] = i
        second[found] = k
        found += boxes_overlap(low, high, lower[k], upper[k])
    return found


def test_few(state, dt):
    """Few bodies move: every pair of them, and they with all static bodies that are in no grid."""
    first, moving, candidates, grid, all_static = state.first, state.moving, state.candidates, state.static_grid, True
    if state.pair_search == STATIC_GRID:
        if moving - first >= UNIFORM_GRID_MIN and state.grid.suits:
            return OK
        all_static = False
    elif state.pair_search != BRUTE_FORCE:
        return OK
    found, stop = 0, state.count if all_static else moving
    for i in range(first, moving):
        if found != FULL:
            found = test_blocks(state, i, i + 1, stop, found)
        if found != FULL:
            found = test_blocks(state, i, 0, first if all_static else 0, found)
    for k in range(0 if all_static else grid.outside_count):
        if found != FULL:
            found = test_row(state, grid.outside[k], first, moving, found)
    if found == FULL:
        return need_more_room(state)
    candidates.count = found
    return OK


@part
def test_blocks(state, i, start, stop, found):
    """The same for many rows, of which few overlap: a block in which none does is ruled out without writing a pair."""
    lower, upper = state.bodies.lower, state.bodies.upper
    low, high = lower[i], upper[i]
    for begin in range(start, stop, BLOCK):
        end, any_meets = min(begin + BLOCK, stop), False
        for k in range(begin, end):
            any_meets |= boxes_overlap(low, high, lower[k], upper[k])
        if any_meets and found != FULL:
            found = test_row(state, i, begin, end, found)
    return found


def search_static_grid(state, dt):
    """What moves looks into the grid of what does not."""
    if state.pair_search != STATIC_GRID:
        return OK
    found = look_near(state, state.static_grid, state.first, state.moving, state.candidates.count)
    if found == FULL:
        return need_more_room(state)
    state.candidates.count = found
    return OK
