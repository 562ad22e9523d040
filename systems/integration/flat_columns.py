"""Passes over whole columns. Their values lie one after the other, (n, d) as (n d,): over such flat columns the
compiler finds vector instructions, which take half the time and less.
"""

from __future__ import annotations

from ...framework.compilation import kernel

LARGEST = 1.7976931348623157e308  # of all finite numbers


@kernel
def invert_masses(dynamic, count, mass, inverse_mass, max_speed):
    """1 / mass of the dynamic bodies, 0 for the others; returns whether any has a limit to its speed (nan: none)."""
    limited = False
    for i in range(dynamic):
        inverse_mass[i] = 1.0 / mass[i]
        limited |= max_speed[i] == max_speed[i]
    for i in range(dynamic, count):
        inverse_mass[i] = 0.0
    return limited


@kernel
def any_turned(count, rotation):
    """Whether any of the first bodies is: an angle that is not 0, in 3D a quaternion with a part beside the first."""
    values = rotation.reshape(rotation.size)
    turned = False
    if rotation.ndim == 1:
        for i in range(count):
            turned |= values[i] != 0.0
    else:
        for i in range(count):
            turned |= (values[4 * i + 1] != 0.0) | (values[4 * i + 2] != 0.0) | (values[4 * i + 3] != 0.0)
    return turned


@kernel
def all_finite(count, position, velocity):
    """Whether the first rows of both hold no inf and no nan."""
    positions, velocities = position.reshape(position.size), velocity.reshape(velocity.size)
    finite = True
    for j in range(count * position.shape[1]):
        finite &= abs(positions[j]) <= LARGEST
        finite &= abs(velocities[j]) <= LARGEST
    return finite
