"""What the laws share: rooms of static walls, and measures over all bodies that move.

A law is a function ``scene(seed, ...)`` that plays a scene and returns figures; its tests compare them with what is
asked for. A few cases of each run in ``make test``, all of them in ``make test-long``. What the solver misses today is
named in the file, with the figure of today, and marked ``long`` too.
"""

from __future__ import annotations

import numpy as np
import pytest
from worlds import MODES, box

SWEPT = MODES[1:]


def cases(every, few=None, missed=()):
    """Cases for ``parametrize``: the first ``few`` of them (None: all) always run, the others are marked long.

    missed: those that the solver misses today. What is asked for stays the same, they run with the long ones.
    """
    every = list(every)
    assert set(missed) <= set(every), "a case that is called missed is none"
    return [
        pytest.param(
            *(case if isinstance(case, tuple) else (case,)),
            marks=pytest.mark.long if case in missed or (few is not None and k >= few) else (),
        )
        for k, case in enumerate(every)
    ]


def seeds(few, every, known=()):
    """Seeds for ``parametrize``: the first ``few`` always run, as do those ``known`` to have failed once; the others up
    to ``every`` are marked long."""
    first = [*range(few), *known]
    return cases([*first, *(seed for seed in range(few, every) if seed not in known)], len(first))


def walls(world, half, thickness, *, open_top=False, **collider):
    """Static walls around a square or cube from -half to half; inner faces there, outer ones ``thickness`` beyond."""
    d = world.dimensions
    for axis in range(d):
        for side in (-1.0, 1.0):
            if open_top and axis == 1 and side > 0:
                continue
            place, extents = np.zeros(d), np.full(d, half + thickness)
            place[axis], extents[axis] = side * (half + 0.5 * thickness), 0.5 * thickness
            box(world, place, half=extents, kind="static", **collider)


def fastest(world):
    """The greatest speed of a body that can move, m/s; inf if one is not finite."""
    speeds = np.linalg.norm(world.bodies.dynamic.linear_velocity, axis=1)
    return float(speeds.max(initial=0.0)) if np.isfinite(speeds).all() else np.inf


def root_mean_square(world):
    """Of all speeds, m/s."""
    return float(np.sqrt((world.bodies.dynamic.linear_velocity**2).sum(axis=1).mean()))


def beyond(world, limit):
    """Number of bodies whose centre is farther than ``limit`` from the origin along an axis, or is not finite."""
    inside = np.abs(world.bodies.dynamic.position) <= limit
    return int((~inside.all(axis=1)).sum())
