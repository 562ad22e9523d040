"""Laws of grains: gravity of a millionth to a million sizes a step; what stands stays, and what falls comes to lie."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from helpers_pairwise import pairwise
from laws.helpers_laws import MODES
from worlds import METHODS, ball, box, make_world

GRAVITIES = (1e-6, 1e-4, 1e-2, 0.1, 1.0, 10.0, 1e2, 1e4, 1e6)  # g dt² in sizes
SUBSTEPS = (1, 4, 32)
WRONG = 0.06  # of a size
TOO_FAST = "so fast that discrete collisions may miss"

# Of bodies of one size each: the maker, x, the height at which it starts, its restitution, and where it must end.
STANDING = {
    "two boxes": [(box, 0.0, 0.5 + k, 0.0, 0.5 + k) for k in range(2)],
    "two balls": [(ball, 0.0, 0.5 + k, 0.0, 0.5 + k) for k in range(2)],
    "both": [(maker, 0.0, 0.5 + k, 0.0, 0.5 + k) for k, maker in enumerate((box, ball, box))],
    "pyramid": [
        (box, 1.01 * k + 0.505 * row, 0.5 + row, 0.0, 0.5 + row) for row in range(4) for k in range(4 - row)
    ],
}
FALLING = {
    "apart": [(ball, 0.0, 3.0, 0.0, 0.5), (box, 10.0, 3.3, 0.0, 0.5)],
    "on each other": [(box, 0.0, 0.5, 0.0, 0.5), (box, 0.0, 4.3, 0.0, 1.5)],
    "both at once": [(box, 0.0, 3.3, 0.0, 0.5), (box, 0.0, 5.0, 0.0, 1.5)],
    "bouncing": [(ball, 0.0, 3.0, 0.5, 0.5), (box, 10.0, 7.7, 0.8, 0.5)],
}


def play(scene, gravity, mode, method="semi_implicit_euler", substeps=4, *, d=2, steps=None):
    """The greatest distance of a body from where it must lie at the end, in sizes, and the faults.

    Whatever it falls in a step, no body passes another or the floor, and none is pressed out of its place. Where
    gravity is weak it takes longer to fall: so many steps that eight sizes are fallen through ten times, at least 120.
    """
    if steps is None:
        steps = max(120, round(10 * (2 * 8.0 / gravity) ** 0.5))
    dt = 1 / 60
    settings = {"collision": mode, "integrator": method, "substeps": substeps, "dt": dt}
    with make_world(d, gravity / dt**2, on_fault="ignore", **settings) as world:
        box(world, (0.0, -1.0, 0.0)[:d], half=(100.0, 1.0, 100.0)[:d], kind="static")
        places = []
        for maker, x, start, e, place in scene:
            maker(world, (x, start, 0.0)[:d], restitution=e)
            places.append(place)
        for _ in range(steps):
            world.step()
        wrong = np.abs(world.bodies.dynamic.position[:, 1] - places)
        return float(wrong.max()) if np.isfinite(wrong).all() else np.inf, list(world.faults)


def check_fall(scene, gravity, mode, method, d):
    """What a discrete world may miss, it must name."""
    wrong, faults = play(FALLING[scene], gravity, mode, method, d=d)
    assert wrong < WRONG or (mode == "discrete" and any(TOO_FAST in text for text in faults))


STRONG = [gravity for gravity in GRAVITIES if gravity >= 0.01]  # else all that falls takes a thousand steps and more


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "gravity", "mode", "method", "substeps"), pairwise(list(STANDING), GRAVITIES, MODES, METHODS, SUBSTEPS)
)
def test_what_stands_stays(scene, gravity, mode, method, substeps):
    wrong, _ = play(STANDING[scene], gravity, mode, method, substeps, steps=120)
    assert wrong < WRONG


@pytest.mark.parametrize(
    ("scene", "gravity", "mode", "method", "d"), pairwise(list(FALLING), STRONG, MODES, METHODS, (2, 3))
)
def test_what_falls_comes_to_lie(scene, gravity, mode, method, d):
    check_fall(scene, gravity, mode, method, d)


@pytest.mark.long
@pytest.mark.parametrize(("scene", "gravity"), list(itertools.product(STANDING, GRAVITIES)))
def test_whatever_stands_stays(scene, gravity):
    found = {
        case: play(STANDING[scene], gravity, *case[:3], d=case[3], steps=120)[0]
        for case in itertools.product(MODES, METHODS, SUBSTEPS, (2, 3))
    }
    assert {case: wrong for case, wrong in found.items() if not wrong < WRONG} == {}


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "gravity", "mode", "method", "d"), list(itertools.product(FALLING, STRONG, MODES, METHODS, (2, 3)))
)
def test_whatever_falls_comes_to_lie(scene, gravity, mode, method, d):
    check_fall(scene, gravity, mode, method, d)
