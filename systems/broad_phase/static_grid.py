"""A uniform grid of what does not move: built once, and whatever moves looks into it (see :mod:`.uniform_grid`).

Static boxes are seldom of one size: a level has walls around it. So the few that are much longer than the others stay
outside the grid, whose cells need not be as large as they are: all that moves is tested with each of them.
"""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import item
from .boxes import fixed_count, fixed_row
from .records import HIGHEST, LARGEST_EXTENT, LOWEST
from .uniform_grid import OUTSIDE_MAX, build_grid

NEVER_BUILT = -1  # in place of a version
ALIKE = 1.25  # boxes that are longer than most by no more than this factor are inside: cells grow by as much


@part
def longest_edge(low, high):
    """Of a box; -1 if it has nan in it."""
    longest, valid = 0.0, True
    for q in range(len(low)):
        edge = item(high, q) - item(low, q)
        valid &= edge == edge
        longest = max(longest, edge)
    return longest if valid else -1.0


@part
def longest_inside(state, grid):
    """The longest edge that a box in the grid may have: OUTSIDE_MAX boxes at most are longer, none of them ALIKE."""
    bodies, longest = state.bodies, grid.longest
    for k in range(OUTSIDE_MAX + 1):
        longest[k] = -math.inf
    for k in range(fixed_count(state)):
        i = fixed_row(state, k)
        edge = longest_edge(bodies.lower[i], bodies.upper[i])
        if edge > longest[0]:  # the shortest of those kept makes way
            k = 0
            while k < OUTSIDE_MAX and longest[k + 1] < edge:
                longest[k] = longest[k + 1]
                k += 1
            longest[k] = edge
    limit = longest[0]
    for k in range(1, OUTSIDE_MAX + 1):
        if longest[k] <= ALIKE * longest[0]:
            limit = longest[k]
    return limit


@part
def divide_boxes(state, grid):
    """Copy the boxes for the grid, find their frame, list the bodies that stay outside; returns how many are inside."""
    bodies, frame, limit, inside, outside = state.bodies, grid.frame, longest_inside(state, grid), 0, 0
    zero = zero_of(grid)
    for q in range(len(zero)):
        frame[LOWEST + q], frame[HIGHEST + q] = math.inf, -math.inf
    frame[LARGEST_EXTENT] = limit
    for k in range(fixed_count(state)):
        i = fixed_row(state, k)
        low, high = bodies.lower[i], bodies.upper[i]
        edge = longest_edge(low, high)
        if edge > limit:
            grid.outside[outside] = i
            outside += 1
        elif edge >= 0.0:
            grid.rows[inside], grid.lower[inside], grid.upper[inside] = i, low, high
            inside += 1
            for q in range(len(zero)):
                frame[LOWEST + q] = min(frame[LOWEST + q], item(low, q))
                frame[HIGHEST + q] = max(frame[HIGHEST + q], item(high, q))
    grid.outside_count = outside
    return inside


@part
def build_static_grid(state):
    """Put the static boxes into their grid, but for the longest; ``suits``: whether there is a grid at all."""
    grid, order = state.static_grid, state.static_grid.order
    inside = divide_boxes(state, grid)
    grid.suits = False
    if inside > 0:
        build_grid(grid, grid.lower, grid.upper, 0, inside)
    if grid.suits:
        for k in range(grid.directory[grid.total]):
            order[k] = grid.rows[order[k]]
    grid.version, grid.first = state.statics_version, state.moving


@part
def follow_rows(state):
    """Static bodies have moved to other rows, all by as many, because others have come or gone before them; sleepers
    have not."""
    grid, by = state.static_grid, state.moving - state.static_grid.first
    for k in range(grid.directory[grid.total] if grid.suits else 0):
        grid.order[k] += by if grid.order[k] >= grid.first else 0
    for k in range(grid.outside_count):
        grid.outside[k] += by if grid.outside[k] >= grid.first else 0
    grid.first = state.moving
