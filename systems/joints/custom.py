"""Rows whose value a function of a plugin gives, see docs/write-a-joint.md: how their bodies move with them.

A row has four vectors, ``along_a``, ``turn_a``, ``normal`` and ``turn_b``: what the velocity and the spin of each body
change of its value per second, and along which its impulse pushes and turns them. The function is linked (see
``linked``) and called in each substep. Where it tells no value this is the sum of these changes.
"""

from __future__ import annotations

from functools import cache

from ...framework.compilation import inlined, part
from ...framework.jit.kinds import FLOAT, INT, Signature, floats, record_kind, tuple_of
from ...framework.vectors import dot
from ..contacts.solving.records import SOLVER
from ..integration.turning import change_of_spin
from ..shapes.linking.signatures import call_in_dimension


@cache
def custom_signature(dimensions: int) -> Signature:
    """(solver, row) -> (value, or NaN where the function tells none, along a, turn of a, along b, turn of b)."""
    vector = floats(dimensions)
    return tuple_of(FLOAT, *(vector,) * 4)(record_kind(SOLVER, dimensions), INT)


call_given = call_in_dimension(custom_signature)


@inlined
def speed_of_custom(solver, j):
    """How fast the value of a row changes."""
    joints = solver.joints
    a, b = joints.first[j], joints.second[j]
    at_a = dot(joints.along_a[j], solver.velocity[a]) + dot(joints.turn_a[j], solver.spin[a])
    return at_a + dot(joints.normal[j], solver.velocity[b]) + dot(joints.turn_b[j], solver.spin[b])


@part
def measure_custom(solver, j, moved_for):
    """The value of a row now. Its sum of changes takes the mean of those before and after a substep."""
    joints = solver.joints
    a, b = joints.first[j], joints.second[j]
    before = speed_of_custom(solver, j) if moved_for > 0.0 else 0.0
    joints.asked = joints.joint[j]
    value, along_a, turn_a, along_b, turn_b = call_given(joints.function[j], solver, j)
    joints.asked = 0
    joints.along_a[j], joints.turn_a[j], joints.normal[j], joints.turn_b[j] = along_a, turn_a, along_b, turn_b
    moved = solver.inverse_mass[a] * dot(along_a, along_a) + dot(turn_a, change_of_spin(solver, a, turn_a))
    moved += solver.inverse_mass[b] * dot(along_b, along_b) + dot(turn_b, change_of_spin(solver, b, turn_b))
    joints.mass[j] = 1.0 / moved if moved > 0.0 else 0.0
    if value != value:
        value = joints.value[j]
        if moved_for > 0.0:
            value += 0.5 * moved_for * (before + speed_of_custom(solver, j))
        else:
            value += dot(along_a, solver.shift[a]) + dot(along_b, solver.shift[b])
    joints.value[j] = value
    return value
