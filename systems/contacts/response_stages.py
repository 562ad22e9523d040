"""The stage that opens the response."""

from __future__ import annotations

from ..codes import OK, RUN_NARROW
from ..narrow_phase.manifolds import move_to_start
from .solving.faults import KINDS_OF_FAULT


def begin_response(state, dt):
    """Where the paths begin; the response is idle if nothing is near anything and nothing rested."""
    if state.collides and not state.contacts_ready:
        return RUN_NARROW
    bodies, pairs, memory = state.bodies, state.pairs, state.warm_start
    near = pairs.found if state.moved else pairs.count  # in a step, what is near at its end is among those found
    unknown = state.sweeping and state.moved and state.neighbours_known_until < dt
    solver = state.solver
    state.response_idle = near + solver.joints.active + memory.counts[memory.now] == 0 and not unknown
    for kind in range(KINDS_OF_FAULT):
        solver.faults[kind] = 0
    solver.islands = state.impacts.halted = 0
    state.impacts_recorded = False
    if state.response_idle:
        return OK
    move_to_start(state)
    for c in range(pairs.count):
        pairs.impulse[c] = 0.0
    if not state.moved:  # the phase is run alone: the bodies stand where they overlap
        state.path_degree = 1
        for i in range(state.count):
            bodies.previous_position[i] = bodies.position[i]
            bodies.path_velocity[i] = bodies.linear_velocity[i]
            bodies.start_velocity[i] = bodies.linear_velocity[i]
    for i in range(state.first, state.moving):
        bodies.origin[i] = bodies.previous_position[i]
    return OK
