"""What moving bodies remember of the static grid, as most of a level is far from each of them, and stays where it is.

A body that looks into the grid looks ahead: with a box that holds its own, some room around it, and where its motion
leads in the next steps. It remembers this view, and which static bodies are in it. As long as its box stays inside of
the view it looks at these alone, and not into the grid.
"""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.vectors import item, replace, sub
from .brute_force import boxes_overlap
from .records import MOST_SEEN
from .uniform_grid import FULL, look_inside

AHEAD = 8.0  # motions of this step by which a view reaches ahead, but no more than the length of the box
AROUND = 0.125  # lengths of the box by which it does on all sides: what is turned aside, or hardly moves, stays inside

NOT_KNOWN = -1  # in place of the number of static bodies


@part
def follow_statics(state):
    """No body knows what it sees any more if static bodies have changed, or any body has another row."""
    views = state.views
    if views.version != state.version or views.statics_version != state.statics_version:
        for i in range(state.first, state.moving):
            views.count[i] = NOT_KNOWN
        views.version, views.statics_version = state.version, state.statics_version


@part
def widened(low, high, motion):
    """The view of a body with this box and the motion of this step."""
    view_low, view_high = low, high
    for q in range(len(low)):
        length, way = item(high, q) - item(low, q), AHEAD * item(motion, q)
        around = AROUND * length
        view_low = replace(view_low, q, item(low, q) - around + min(0.0, max(way, -length)))
        view_high = replace(view_high, q, item(high, q) + around + max(0.0, min(way, length)))
    return view_low, view_high


@part
def is_inside(view_low, view_high, low, high):
    """Whether a view holds the box; it holds none with nan."""
    inside = True
    for q in range(len(low)):
        inside &= (item(view_low, q) <= item(low, q)) & (item(high, q) <= item(view_high, q))
    return inside


@part
def look_ahead(state, i, found):
    """Look into the grid with a new view of body i and remember it; returns the number of candidates, or FULL."""
    bodies, views, candidates = state.bodies, state.views, state.candidates
    motion = sub(bodies.position[i], bodies.previous_position[i])
    low, high = widened(bodies.lower[i], bodies.upper[i], motion)
    stop = look_inside(state, state.static_grid, i, low, high, found)
    if stop == FULL:
        return FULL
    seen, first, second, before = stop - found, candidates.first, candidates.second, found
    views.count[i] = NOT_KNOWN
    if seen <= MOST_SEEN:
        views.lower[i], views.upper[i], views.count[i] = low, high, seen
        for k in range(seen):
            views.seen[i, k] = first[before + k]
    low, high = bodies.lower[i], bodies.upper[i]
    for k in range(before, stop):
        there = first[k]
        first[found], second[found] = there, i
        found += boxes_overlap(low, high, bodies.lower[there], bodies.upper[there])
    return found


@part
def test_known_statics(state, i, found):
    """The static bodies in the grid whose boxes overlap that of body i; returns the number of candidates, or FULL."""
    bodies, views, candidates = state.bodies, state.views, state.candidates
    low, high, count = bodies.lower[i], bodies.upper[i], views.count[i]
    if count == NOT_KNOWN or not is_inside(views.lower[i], views.upper[i], low, high):
        return look_ahead(state, i, found)
    if found + count > len(candidates.first):
        return FULL
    for k in range(count):
        there = views.seen[i, k]
        candidates.first[found], candidates.second[found] = there, i
        found += boxes_overlap(low, high, bodies.lower[there], bodies.upper[there])
    return found


def reserve_static_neighbours(views, count):
    """Room for so many moving bodies, which know nothing yet. Called from Python, by the owner of the record."""
    views.reserve(count * 3 // 2, "lower", "upper", "count", "seen")
    views.version = NOT_KNOWN
