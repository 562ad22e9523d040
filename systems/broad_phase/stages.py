"""The stages of BROAD that find candidate pairs: bodies whose boxes overlap, at least one of them moving.

Sleepers count as static. ``choose_search`` decides by the numbers of bodies, and by whether the grids suit these, which
are made before:

    moving                       pairs of what moves
    less than UNIFORM_GRID_MIN   brute force
    none that layers let meet    none
    more                         uniform grid, into which the kinematic ones look if they are few

    static                       pairs with what does not move
    no more than move, or        brute force; or the static bodies look into the uniform grid of what moves
      than BRUTE_FORCE_MAX
    more                         what moves looks into the static grid; the few long ones that are not in it, as above

Where boxes differ too much in size for a grid, or crowd in one place, trees are used: Python builds these
(FIND_IN_PYTHON).
"""

from __future__ import annotations

from ...framework.compilation import inlined, packed, part
from ...framework.schedule.stages import Rows, asked
from ..codes import FIND_IN_PYTHON, NEED_ROOM, OK
from ..records import FOUND
from .boxes import fixed_count, fixed_row, grid_stop
from .brute_force import BRUTE_FORCE_MAX, boxes_overlap
from .records import FRAME_SIZE, GRID_BOXES, GRID_STATICS
from .static_grid import build_static_grid, follow_rows
from .uniform_grid import (
    CELLS_PER_BOX,
    FULL,
    LANES,
    SPARE_CELLS,
    build_grid,
    look_around,
    look_inside,
    look_near,
    test_notes,
)

# 8 million candidates: with everything that is kept of a pair about 4 gigabytes. A game has 1 to 50 per body.
CANDIDATE_LIMIT = 1 << 23

# Moving bodies from which a uniform grid is tried. It is faster from about 32 on, but a scene of few bodies starts
# sooner if its kernels need not be compiled.
UNIFORM_GRID_MIN = BRUTE_FORCE_MAX + 1

SEARCH_BLOCK = 16  # boxes that are ruled out together: where bodies lie on each other 64 hardly ever are

# Values of ``state.pair_search``: what finds the candidates of this step.
NO_SEARCH, BRUTE_FORCE, UNIFORM_GRID, SPATIAL_TREE, PLUGIN = range(5)


@part
def has_many_static(moving, static, meet):
    """Whether so many static bodies are in a grid of their own, if that suits them. meet: bodies that move may meet."""
    return static > max(moving if meet else 0, BRUTE_FORCE_MAX)


@part
def has_static_grid(state):
    """The same of the bodies that there are."""
    return has_many_static(state.moving - state.first, fixed_count(state), state.moving_meet)


@part
def looks_into_statics(state):
    """Whether what moves looks into the grid of what does not, however pairs of what moves are found."""
    by_grids = state.pair_search == BRUTE_FORCE or state.pair_search == UNIFORM_GRID
    return by_grids and has_static_grid(state)


@part
def leave_to_trees(state):
    """No grid suits, or there are more pairs than allowed: the tree counts them. The stages that follow do nothing."""
    state.candidates.count = 0
    state.pair_search = SPATIAL_TREE
    return FIND_IN_PYTHON


@part
def note_found(state, found):
    """So many candidates; or, where there was no room for all, twice as much room, while that is allowed."""
    if found != FULL:
        state.candidates.count = found
        return OK
    room = len(state.candidates.first)
    if room >= CANDIDATE_LIMIT:
        return leave_to_trees(state)
    state.needed = min(2 * max(room, BRUTE_FORCE_MAX), CANDIDATE_LIMIT)
    return NEED_ROOM


@part
def forget_queries(state, grid):
    """Queries that look into this grid make it again."""
    state.motion_version += grid.serves
    grid.serves = False


@part
def static_boxes(state):
    """How many boxes may be in the grid of what does not move, or be read past the last; 0: there is none."""
    some = not state.all_still and not state.uses_plugin_broad_phase and has_static_grid(state)
    return fixed_count(state) + LANES if some else 0


@part
def moving_boxes(state):
    """The same of what moves."""
    some = not state.all_still and not state.uses_plugin_broad_phase
    return state.moving - state.first + LANES if some and state.moving - state.first >= UNIFORM_GRID_MIN else 0


@inlined
def most_cells(boxes):
    """Of a grid, with those that are counted in."""
    return int(CELLS_PER_BOX * boxes) + SPARE_CELLS + 4


ROOM_FOR_STATICS = (
    Rows("static_grid", (*GRID_BOXES, *GRID_STATICS), static_boxes),
    Rows("static_grid", ("directory",), lambda s: most_cells(static_boxes(s))),
)  # fmt: skip
ROOM_FOR_MOVING = (
    Rows("grid", GRID_BOXES, moving_boxes),
    Rows("grid", ("directory",), lambda s: most_cells(moving_boxes(s))),
)  # fmt: skip
ROOM_FOR_CANDIDATES = (Rows("candidates", FOUND, asked),)


@part
def build_statics(state):
    """The grid of what does not move, when that has changed."""
    grid = state.static_grid
    if grid.version != state.statics_version:
        build_static_grid(state)
        forget_queries(state, grid)
    elif grid.first != state.moving:
        follow_rows(state)


def place_statics(state, dt):
    """Where more bodies are static than move: their grid."""
    if static_boxes(state) > 0:
        build_statics(state)
    return OK


@part
def build_moving_grid(state):
    """A uniform grid of what moves, if that is even enough for it."""
    grid, bodies = state.grid, state.bodies
    for k in range(FRAME_SIZE):
        grid.frame[k] = state.frame[k]
    stop = grid_stop(state)
    build_grid(grid, bodies.lower, bodies.upper, state.first, stop - state.first)
    grid.version, grid.first, grid.outside_count = state.version, state.first, state.moving - stop
    for k in range(grid.outside_count):
        grid.outside[k] = stop + k
    forget_queries(state, grid)


@packed
def place_moving(state, dt):
    """Where many bodies move: their grid."""
    if moving_boxes(state) > 0:
        build_moving_grid(state)
    return OK


def choose_search(state, dt):
    """No candidates yet; and how they are to be found."""
    state.candidates.count = 0
    state.pair_search = NO_SEARCH
    if not state.collides or state.all_still:
        return OK
    if state.uses_plugin_broad_phase:
        state.pair_search = PLUGIN
        return FIND_IN_PYTHON
    few = state.moving - state.first < UNIFORM_GRID_MIN or not state.moving_meet
    if not (few or state.grid.suits) or (has_static_grid(state) and not state.static_grid.suits):
        return leave_to_trees(state)
    state.pair_search = BRUTE_FORCE if few else UNIFORM_GRID
    return OK


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


@part
def look_from_outside(state, found):
    """Static bodies that are in no grid look into that of what moves, and at what moves but is in none; so does this.
    Returns the number of pairs, or FULL."""
    static_grid, all_static, stop = state.static_grid, not looks_into_statics(state), grid_stop(state)
    count = fixed_count(state) if all_static else static_grid.outside_count
    for k in range(count + state.moving - stop):
        moves = k >= count
        i = stop + k - count if moves else fixed_row(state, k) if all_static else static_grid.outside[k]
        found = look_inside(state, state.grid, i, state.bodies.lower[i], state.bodies.upper[i], found)
        if found != FULL:
            found = test_row(state, i, i + 1 if moves else stop, state.moving, found)
        if found == FULL:
            break
    return found


@packed
def search_uniform_grid(state, dt):
    """Many bodies move: pairs of what is in the grid, and those with static bodies that are in none."""
    if state.pair_search != UNIFORM_GRID:
        return OK
    grid, at, found = state.grid, 0, 0
    count = grid.directory[grid.total]  # without invalid boxes
    while at < count and found != FULL:
        held, at = look_around(grid, at, count)
        found = test_notes(state, held, found)
    if found != FULL:
        found = look_from_outside(state, found)
    return note_found(state, found)


def test_few(state, dt):
    """Few bodies move, or none that meet: every pair of them, and they with all static bodies that are in no grid."""
    first, moving, grid = state.first, state.moving, state.static_grid
    all_static = not looks_into_statics(state)
    if state.pair_search != BRUTE_FORCE:
        return OK
    found, stop = 0, state.count if all_static else moving
    for i in range(first, moving):
        found = test_blocks(state, i, i + 1, moving if state.moving_meet else i, found)
        found = test_blocks(state, i, moving, stop, found)  # apart from these, as most lie on a static body
        found = test_blocks(state, i, 0, first if all_static else 0, found)
    for k in range(0 if all_static else grid.outside_count):
        if found != FULL:
            found = test_row(state, grid.outside[k], first, moving, found)
    return note_found(state, found)


@part
def test_blocks(state, i, start, stop, found):
    """The same for many rows, of which few overlap: a block in which none does is ruled out without writing a pair.
    ``found`` may be FULL, and stays so."""
    lower, upper = state.bodies.lower, state.bodies.upper
    low, high = lower[i], upper[i]
    for begin in range(start, stop, SEARCH_BLOCK):
        end, any_meets = min(begin + SEARCH_BLOCK, stop), False
        for k in range(begin, end):
            any_meets |= boxes_overlap(low, high, lower[k], upper[k])
        if any_meets and found != FULL:
            found = test_row(state, i, begin, end, found)
    return found


@part
def look_into_statics(state):
    """Pairs of what moves with what is in the static grid; returns a code."""
    return note_found(
        state, look_near(state, state.static_grid, state.first, state.moving, state.candidates.count)
    )


def search_static_grid(state, dt):
    """What moves looks into the grid of what does not."""
    return look_into_statics(state) if looks_into_statics(state) else OK
