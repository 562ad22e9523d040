"""Passes over the rows of a range; in hard islands until they agree."""

from __future__ import annotations

from ....framework.compilation import inlined, part
from ..constants import FRICTION_OVERRELAXATION, ISLAND_WORK, MOST_REPEATS, NEGLIGIBLE
from .chunks import solve_chunks
from .rows import closing_speed, look_ahead, relax_row, solve_friction, solve_normals, solve_rolling


@part
def solve_pass(solver, bias, pushes, over, span, arms):
    """One pass over the rows of a range, normals and friction. over: see FRICTION_OVERRELAXATION."""
    if len(arms) > 0 and solver.has_rolling:
        solve_rolling(solver, span)
    if len(arms) > 0:
        solve_chunks(solver, bias, pushes, span)
    else:
        solve_normals(solver, bias, pushes, span, arms)
        if solver.has_friction:
            solve_friction(solver, over, span, arms)
    solver.visits += span[1] - span[0]


@inlined
def most_repeats(rows):
    """How many substeps, or passes in one, so many rows may have."""
    return min(MOST_REPEATS, ISLAND_WORK // rows)


@part
def note_impulses(solver, span):
    """What the impulses are before a pass or a substep."""
    for k in range(span[0], span[1]):
        solver.previous[k] = solver.impulse[k]


@part
def agrees(solver, h, span):
    """Whether the last pass has changed nothing that matters."""
    any_wrong = False
    for k in range(span[0], span[1]):
        way = abs(solver.impulse[k] - solver.previous[k]) * h / solver.mass[k]
        any_wrong |= not way <= NEGLIGIBLE * solver.extent[k]
    return not any_wrong


@part
def solve_passes(solver, pushes, passes, stiff, h, span, arms):
    """So many ``passes`` over a range, and over a ``stiff`` one more, until they agree."""
    if len(arms) > 0:
        look_ahead(solver, 0.5 * h, span)
    bias, most = solver.pushing if pushes else solver.target_speed, passes
    if stiff:
        most = max(passes, most_repeats(span[1] - span[0]))
    for left in range(passes - 1, passes - 1 - most, -1):
        if stiff:
            note_impulses(solver, span)
        over = FRICTION_OVERRELAXATION if left > 0 and not pushes else 1.0
        solve_pass(solver, bias, pushes, over, span, arms)
        if stiff and left <= 0 and agrees(solver, h, span):
            break
    if len(arms) > 0:
        look_ahead(solver, -0.5 * h, span)


@part
def sort_by(places, count, keys):
    """The first ``count`` of some places in the order of their keys, the lower one first where these are equal; Shell's
    sort."""
    stride = count // 2
    while stride > 0:
        for e in range(stride, count):
            k, at = places[e], e
            while at >= stride and (
                keys[places[at - stride]] > keys[k]
                or (keys[places[at - stride]] == keys[k] and places[at - stride] > k)
            ):
                places[at] = places[at - stride]
                at -= stride
            places[at] = k
        stride //= 2


@part
def close_nearest_first(solver, h, span, arms):
    """For bodies that fall far in a substep: activate rows as they close, the nearest first, each once those before it
    agree.

    Activating all rows at once does not converge: a pass takes back of an impulse no more than what is open, and the
    impulse of a row which another one should have held before is as high as a whole fall.
    """
    count, work, listed = span[1] - span[0], ISLAND_WORK, solver.listed
    for e in range(count):
        listed[e] = span[0] + e
    sort_by(listed, count, solver.target_speed)
    for e in range(count):
        k = listed[e]
        new = closing_speed(solver, k, arms) > solver.target_speed[k]
        while new and work > 0:
            note_impulses(solver, span)
            for i in range(e + 1):
                relax_row(solver, listed[i], arms)
            solver.visits += e + 1
            work -= e + 1
            new = not agrees(solver, h, span)
