"""Where there are joints, or a ball with its mass off the middle touches, bodies in space turn within the step as they
do by themselves: in each substep about their angular momentum, and their inertia with them. What joints give to one of
two bodies they take from the other, so the momentum of both stays what it is, and their turning changes no energy.

The flight has turned the bodies to the end of the step. They go back to its start and come on from there.
"""

from __future__ import annotations

import math

from ....framework.compilation import packed, part
from ....framework.elementary import atan2
from ....framework.jit.records.record_type import zero_of
from ....framework.vectors import add_scaled, components, dot, length, scale, triple
from ...codes import OK
from ...integration.turning import SERIES, change_of_spin, quaternion_of
from ...shapes.free_rotation import diagonalised, energy_of, turn_freely, turn_to_energy
from ...shapes.poses import NO_INERTIA, has_unequal_moments, momentum_along
from ...shapes.quaternions import product, rotate, rotation_in_space, turned_tensor
from .rows import rotate_body

NOT_TUMBLING = 2.0  # in place of the first number of a unit quaternion
DIAGONAL_ROUNDING = 1e-14  # of the trace: what is off the diagonal by less is rounding


@part
def note_frame(state, q):
    """The principal axes of body q of the solver where the flight has turned it, and 1 / moments about them."""
    solver, i = state.solver, state.solver.body_row[q]
    solver.frame[q, 0] = NOT_TUMBLING
    if not (state.bodies.inverse_mass[i] > 0.0 and has_unequal_moments(state, i)):
        return
    frame, v, u = rotation_in_space(state, i), state.bodies.inverse_inertia[i], state.bodies.inverse_products[i]
    back = frame[0], -frame[1], -frame[2], -frame[3]
    xx, yy, zz, xy, xz, yz = turned_tensor(back, (*components(v), *components(u)))
    least = DIAGONAL_ROUNDING * (xx + yy + zz)
    if abs(xy) > least or abs(xz) > least or abs(yz) > least:
        (xx, yy, zz), own = diagonalised(xx, yy, zz, xy, xz, yz)
        frame = product(frame, own)
    least = NO_INERTIA * max(xx, max(yy, zz))
    inverse = xx if xx > least else 0.0, yy if yy > least else 0.0, zz if zz > least else 0.0
    solver.inverse_moments[q] = triple(v, inverse)
    for k in range(4):
        solver.frame[q, k] = frame[k]


@part
def rotate_by_small_turn(frame, m, inverse, h):
    """As :func:`turn_freely`, by the midpoint rule: for small angles."""
    x, y, z = m[0] * inverse[0], m[1] * inverse[1], m[2] * inverse[2]
    half, energy = 0.5 * h, energy_of(m, inverse)
    x, y, z = (
        h * inverse[0] * (m[0] + half * (m[1] * z - m[2] * y)),
        h * inverse[1] * (m[1] + half * (m[2] * x - m[0] * z)),
        h * inverse[2] * (m[2] + half * (m[0] * y - m[1] * x)),
    )
    square = 0.25 * (x * x + y * y + z * z)
    sine = 0.5 * (1.0 - square * (1 / 6 - square * (1 / 120 - square * (1 / 5_040 - square / 362_880))))
    by = math.sqrt(1.0 - 4.0 * square * sine * sine), sine * x, sine * y, sine * z
    m = rotate(by, m, True)
    return product(frame, by), m, energy_of(m, inverse) - energy


@part
def rotation_vector(like, q):
    """The vector by which a unit quaternion turns."""
    sine = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    size = 2.0 * atan2(math.copysign(sine, q[0]), abs(q[0])) / sine if sine > 0.0 else 0.0
    return triple(like, (size * q[1], size * q[2], size * q[3]))


@part
def integrate_free_rotation(solver, q, h):
    """Body q turns by itself for a time. What its momentum was before the impulses of the substep stays that, so that
    less of them may act in the end, see guard; but that has no more energy than it had, and what it has less is no
    gain of theirs."""
    frames = solver.frame
    spin, before, inverse = solver.spin[q], solver.spin_before[q], components(solver.inverse_moments[q])
    frame = frames[q, 0], frames[q, 1], frames[q, 2], frames[q, 3]
    m = momentum_along(frame, inverse, spin)
    momentum = triple(spin, rotate(frame, momentum_along(frame, inverse, before), False))
    little = h * h * dot(spin, spin) < SERIES and dot(solver.turn[q], solver.turn[q]) < SERIES
    if little:
        to, m, gained = rotate_by_small_turn(frame, m, inverse, h)
    else:
        to, m, gained = turn_freely(frame, m, inverse, h)
    to, m = turn_to_energy(to, m, inverse, gained)
    for k in range(4):
        frames[q, k] = to[k]
    xx, yy, zz, xy, xz, yz = turned_tensor(to, (inverse[0], inverse[1], inverse[2], 0.0, 0.0, 0.0))
    solver.inverse_inertia[q], solver.inverse_products[q] = triple(spin, (xx, yy, zz)), triple(spin, (xy, xz, yz))
    solver.spin[q] = triple(spin, rotate(to, (m[0] * inverse[0], m[1] * inverse[1], m[2] * inverse[2]), False))
    turned = change_of_spin(solver, q, momentum)
    had, has = dot(momentum, before), dot(momentum, turned)
    solver.spin_before[q] = scale(turned, math.sqrt(had / has)) if has > had else turned
    if solver.island[q] >= 0:
        solver.credit[solver.island[q]] += 0.5 * max(0.0, had - has)
    by = product(to, (frame[0], -frame[1], -frame[2], -frame[3]))
    rotate_body(solver, q, rotation_vector(spin, product(by, quaternion_of(solver.turn[q]))))


@packed
def tumble(solver, h, span):
    """The bodies of a range go on turning for a time."""
    for q in range(span[2], span[3]):
        if solver.frame[q, 0] == NOT_TUMBLING:
            rotate_body(solver, q, add_scaled(solver.turn[q], solver.spin[q], h))
        elif length(solver.spin[q]) > 0.0:
            integrate_free_rotation(solver, q, h)
    return OK


def turn_back(state, dt):
    """Bodies that tumble turn by themselves to where the step starts."""
    solver, nothing = state.solver, zero_of(state)
    for q in range(solver.bodies):
        note_frame(state, q)
        solver.spin_before[q] = nothing
        if solver.frame[q, 0] != NOT_TUMBLING:
            rotate_body(solver, q, nothing)
            if length(solver.spin[q]) > 0.0:
                integrate_free_rotation(solver, q, -dt)
    return OK
