"""Hard contacts do not give way: those of a body that nothing presses on, with what cannot be moved.

Soft contacts sag, by an amount that depends on how many there are. A body that slides over floors which lie flush would
rise and sink at each seam, and meet the next floor's corner below its own underside.
"""

from __future__ import annotations

from ....framework.compilation import part
from ....framework.vectors import dot, sub
from ...integration.turning import is_turned
from ...narrow_phase.manifolds import centre_offset, centre_offset_at_start
from ..constants import NEGLIGIBLE, UNREACHED
from .rows import closing_speed, separation_from_rotation


@part
def moved_body(solver, k):
    """The body of row k that can be moved; the first if both can."""
    first = solver.first[k]
    return first if solver.inverse_mass[first] > 0.0 else solver.second[k]


@part
def is_loaded(solver, k, dt):
    """Whether contact k, of two bodies that can be moved, bears a load, or will: they overlap."""
    a, b, acceleration, impulse = solver.first[k], solver.second[k], solver.acceleration, solver.impulse[k]
    if solver.gap[k] < -NEGLIGIBLE * solver.extent[k]:
        return True
    least = NEGLIGIBLE * solver.mass[k] * dt
    load = max(dot(acceleration[a], acceleration[a]), dot(acceleration[b], acceleration[b]))
    return impulse > 0.0 and impulse * impulse > least * least * load


@part
def select_rigid(state, dt, nothing, arms):
    """Contacts with what cannot be moved are hard if their body has rested until now, and nothing presses on it.

    Not one that stands for several faces: how much it overlaps each of them says which way it pushes.
    """
    solver, warm_started = state.solver, state.bodies.warm_started
    inverse_mass, pressed = solver.inverse_mass, solver.held
    for q in range(solver.bodies):
        pressed[q] = 0.0
    for k in range(solver.contacts):
        a, b = solver.first[k], solver.second[k]
        move = inverse_mass[a] > 0.0 and inverse_mass[b] > 0.0
        if move and not (pressed[a] > 0.0 and pressed[b] > 0.0) and is_loaded(solver, k, dt):
            pressed[a] = pressed[b] = 1.0
    any_apart = False
    for k in range(solver.contacts):
        a, b = solver.first[k], solver.second[k]
        may_be, solver.hard[k] = solver.hard[k], False
        if inverse_mass[a] == 0.0 or inverse_mass[b] == 0.0:
            body = moved_body(solver, k)
            rested = state.any_warm_started and warm_started[solver.body_row[body]]
            hard = may_be and rested and not pressed[body] > 0.0
            solver.hard[k] = hard
            any_apart |= hard and solver.apart[k]
            if hard and solver.apart[k]:
                least = min(0.0, -separation_from_rotation(solver, k, arms))
                solver.gap[k] = max(least, solver.gap[k])  # faces that meet in the end do not overlap at the start
                if closing_speed(solver, k, arms) < 0.0:  # the body has passed the corner
                    solver.impulse[k], solver.tangent[k] = 0.0, nothing
    if any_apart:
        disable_out_of_reach(state)


@part
def disable_out_of_reach(state):
    """A hard contact that is open at the start of the step and not reached in the prediction is none in this step, if
    its body is held by another one: the body may slide past that corner, whose plane lies across its way."""
    solver, bodies, pairs, held = state.solver, state.bodies, state.pairs, state.solver.held
    for q in range(solver.bodies):
        held[q] = 0.0
    for k in range(solver.contacts):
        if solver.hard[k] and not solver.apart[k]:
            held[solver.first[k]] = held[solver.second[k]] = 1.0
    for r in range(solver.contacts):
        k, c = solver.slot[r], solver.pair[r]
        if solver.hard[k] and solver.apart[k]:
            body = moved_body(solver, k)
            a, b = pairs.a[c], pairs.b[c]
            if state.spinning and (is_turned(bodies, a) or is_turned(bodies, b)):
                continue  # turning brings its points nearer as well
            travel = sub(centre_offset(bodies, a, b), centre_offset_at_start(bodies, a, b))
            if held[body] > 0.0 and solver.gap[k] + dot(travel, solver.normal[k]) > NEGLIGIBLE * solver.extent[k]:
                solver.gap[k] += UNREACHED * solver.extent[k]
