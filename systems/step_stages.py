"""The stages that open and close a step, whatever systems there are."""

from __future__ import annotations

from ..framework.compilation import part
from ..framework.data.column_copies import copy_all
from .broad_phase.boxes import box_motions, box_statics
from .ccd.search_bounds import DISCRETE
from .codes import INDEX, NEED_SWEEPS, OK, ROTATE
from .parts.stages import add_masses_of_parts
from .shapes.attribution import NOTHING_TESTED

FEW_BODIES = 160  # that are looked at one by one

make_static_boxes, make_moving_boxes = part(box_statics), part(box_motions)

OPENED, KEEPS_VELOCITY, KEEPS_START, KEEPS_FORCE, KEEPS_WRITTEN, KEEPS_HOLD = 1, 2, 4, 8, 16, 32  # bits of state.kept
LARGEST_FLOAT = 1.7976931348623157e308  # of all finite numbers


@part
def any_rotation(state):
    """Whether any body is rotated: an angle that is not 0, in 3D a quaternion with a part beside the first."""
    rotation, out, rotated = state.bodies.rotation, state.bodies.quarantined, False
    if len(rotation) == 0:
        return False
    if len(state.gravity[0]) == 2:
        for i in range(state.count):
            rotated |= (rotation[i] != 0.0) & (not out[i])
    else:
        for i in range(state.count):
            turned = (rotation[4 * i + 1] != 0.0) | (rotation[4 * i + 2] != 0.0) | (rotation[4 * i + 3] != 0.0)
            rotated |= turned & (not out[i])
    return rotated


@part
def any_ccd(state):
    """Whether any moving body is swept in a discrete world."""
    ccd, out, found = state.bodies.ccd, state.bodies.quarantined, False
    for i in range(state.moving if len(ccd) > 0 else 0):
        found |= ccd[i] and not out[i]
    return found


def keep_state(state, dt):
    """The velocity, which a step that fails puts back (see stage_list.KEPT). Nothing is known of this step yet.

    If nothing changes the velocity before keep_start, start_velocity has it too.
    """
    bodies, pairs, impacts, first = state.bodies, state.pairs, state.impacts, state.first
    state.unforced, state.pushed, state.moved, state.has_parts = False, True, False, False
    state.forces_summed = state.candidates_ready = state.contacts_ready = False
    state.event_count, state.flight_usual = 0, False
    pairs.count = pairs.found = pairs.resting_count = pairs.disabled_count = pairs.touching_count = 0
    impacts.logged = impacts.capped = 0
    state.candidates.count = 0
    state.row_a, state.unsound = NOTHING_TESTED, 0
    state.all_still, state.sleep_stages = False, 0
    state.kept_rows = state.moving if state.collides and state.boxed_version == state.statics_version else state.count
    state.kept, state.kept_first = OPENED, first
    state.force_first = 0 if state.others_write or state.has_force_systems or state.pushes else first
    if not state.others_write and (state.collides or len(bodies.max_linear_speed) > 0):
        state.kept |= KEEPS_VELOCITY
        for i in range(first, state.moving):
            bodies.kept_velocity[i] = bodies.linear_velocity[i]
    state.warm_start.before, state.contacts.before = state.warm_start.now, state.contacts.now
    return OK


def keep_written(state, dt):
    """Copies of what stages of plugins write, before any of them runs: a step that fails puts them back."""
    copy_all(state.plugin_stages[state.stage])
    state.kept |= KEEPS_WRITTEN
    return OK


@part
def axes_are_old(state):
    """Whether some body is not turned as it was when its axes were made. What turns it in a step makes them, too."""
    rotation, known, old = state.bodies.rotation, state.bodies.axes_rotation, False
    numbers = state.count * (1 if len(state.gravity[0]) == 2 else 4)
    if len(known) < numbers:
        return True
    for k in range(numbers):
        old |= rotation[k] != known[k]
    return old


def read_bodies(state, dt):
    """1 / mass of what moves freely; whether any speed is limited, any body swept or rotated."""
    bodies, limited = state.bodies, False
    mass, inverse_mass = bodies.mass, bodies.inverse_mass
    limit, out, first, dynamic = bodies.max_linear_speed, bodies.quarantined, state.first, state.dynamic
    for i in range(first, dynamic):
        inverse_mass[i] = 1.0 / mass[i]
    for i in range(first, dynamic if state.quarantining else 0):
        if out[i]:
            inverse_mass[i] = 0.0
    for i in range(first, dynamic if len(limit) > 0 else 0):
        limited |= (limit[i] == limit[i]) & (not out[i])
    every = state.read_version != state.statics_version or state.inverse_masses_exposed
    for i in range(dynamic, state.count if every else state.moving):
        inverse_mass[i] = 0.0
    add_masses_of_parts(state)
    state.limits_speed, state.spinning = limited, False
    state.sweeping = state.collides and (state.mode != DISCRETE or any_ccd(state))
    if state.sweeping and not state.sweeps_ready:
        return NEED_SWEEPS
    state.read_version = state.statics_version
    rotated = state.collides and (state.rotated or any_rotation(state))
    if state.rotation_stale or (rotated and (not state.rotated or state.several_levels or axes_are_old(state))):
        return ROTATE
    return OK


def index_bodies(state, dt):
    """Where the bodies are now, for stages of plugins that query: systems of the game may have moved them. Few bodies
    need boxes alone, others grids or trees."""
    turned = state.rotated or any_rotation(state)
    state.rotation_stale |= turned and (not state.rotated or axes_are_old(state))
    if state.count > FEW_BODIES or state.rotation_stale:
        return INDEX
    moved, known_until = state.moved, state.neighbours_known_until
    ready, still = state.candidates_ready, state.all_still
    state.moved = state.all_still = False
    make_static_boxes(state, dt)
    make_moving_boxes(state, dt)
    state.moved, state.neighbours_known_until = moved, known_until
    state.candidates_ready, state.all_still = ready, still
    return OK


def close_step(state, dt):
    """The step is over, and nothing is put back any more."""
    state.moved = False
    if state.unsound == 0:  # else Python goes back after this stage
        state.kept = 0
    state.motion_version += 1
    state.bodies_counted += state.moving - state.first
    return OK
