"""Laws of loads: heavy bodies on light ones, tall towers, and blows from above."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import pytest
from helpers_pairwise import pairwise
from helpers_rest import G, heights, overlaps, speed, tower
from laws.helpers_laws import MODES
from worlds import ball, both_dimensions, floor, make_world

LOADS = (10.0, 1e2, 1e3, 1e4, 1e5, 1e6)
HUGE = (1e9, 1e12)


class Stand(NamedTuple):
    """A tower of boxes of 1 m: the greatest overlap at any step, m; the greatest speed in the last second, m/s; how far
    the highest has come down, m; whether it was in order at every step; the faults."""

    overlap: float
    speed: float
    sinks: float
    in_order: bool
    faults: list[str]


def stand(mode, masses, *, d=2, seconds=10, substeps=4):
    """Boxes on each other on a floor, the lowest first.

    A contact at rest under a load F is compressed by F / (m w²), m the reduced mass of its two bodies and w a quarter
    of the substeps' rate; where that would be much, the island gets more substeps. So overlaps stay small whatever lies
    on top, and what stands stays.
    """
    with make_world(d, G, collision=mode, substeps=substeps, on_fault="ignore") as world:
        floor(world)
        boxes = tower(world, len(masses), masses=masses)
        deepest = last = 0.0
        in_order = True
        for step in range(seconds * 60):
            world.step()
            overlap = overlaps(world, boxes)
            in_order = in_order and bool((overlap < 1.0).all())  # False also if one is not finite
            deepest = max(deepest, float(overlap.max()))
            if step >= (seconds - 1) * 60:
                last = max(last, speed(world))
        sinks = len(masses) - 0.5 - float(heights(world, boxes)[-1])
        return Stand(deepest, last, sinks, in_order, list(world.faults))


@pytest.mark.parametrize(("count", "load", "mode", "d"), pairwise((1, 5), LOADS, MODES, (2, 3)))
def test_boxes_carry_a_load(count, load, mode, d):
    found = stand(mode, (1.0,) * count + (load,), d=d)
    assert found.in_order
    assert found.overlap <= 0.005
    assert found.speed < 1e-4
    assert not found.faults


@pytest.mark.slow
@pytest.mark.parametrize(("count", "load", "mode"), pairwise((1, 3, 7), HUGE, MODES))
def test_a_load_beyond_all_bounds_passes_through_nothing(count, load, mode):
    """It stands, or a fault says that it is too much; in any case all stay in order, and what lies below stays."""
    found = stand(mode, (1.0,) * count + (load,))
    assert found.in_order
    assert found.faults or (found.overlap <= 0.005 and found.speed < 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("masses", [(1, 1, 1, 1e4), (1, 1e4, 1, 1e4), (1e4, 1, 1, 1e4), (1e4, 1, 1e4, 1)])
def test_heavy_on_light_comes_to_rest(mode, masses):
    found = stand(mode, masses)
    assert found.speed < 1e-3
    assert found.overlap < 0.05
    assert found.sinks < 0.05


@pytest.mark.parametrize("mode", MODES)
def test_ten_boxes_hardly_sink(mode):
    found = stand(mode, (1.0,) * 10)
    assert found.sinks < 0.007
    assert found.overlap < 0.005


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("mode", MODES)
def test_a_tower_of_forty_is_at_rest(mode, d):
    assert stand(mode, (1.0,) * 40, d=d).speed < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_tower_of_two_hundred_stands(mode):
    found = stand(mode, (1.0,) * 200, seconds=20)
    assert found.in_order
    assert found.speed < 0.01


# -- blows -----------------------------------------------------------------------------------------


class Blow(NamedTuple):
    """The thinnest that any of the boxes was squeezed to, of its size; the greatest speed at the end, m/s."""

    thinnest: float
    speed: float


def blow(mode, mass, e, *, d=2, height=14.0):
    """A ball of ``mass`` kg falls on five boxes of 1 kg at rest on each other.

    The shock passes through all of them within the step: nothing is squeezed by what a contact at rest would allow.
    """
    with make_world(d, G, collision=mode, on_fault="ignore") as world:
        floor(world)
        boxes = tower(world, 5, restitution=e)
        ball(world, (0.0, height, 0.0)[:d], mass=mass, restitution=e)
        thinnest = 1.0
        for _ in range(400):
            world.step()
            thinnest = min(thinnest, 1.0 - float(overlaps(world, boxes).max()))
        return Blow(thinnest, speed(world))


@both_dimensions
@pytest.mark.parametrize(("e", "mode"), list(itertools.product((0.0, 0.5), MODES)))
def test_a_blow_squeezes_nothing(e, mode, d):
    found = blow(mode, 100.0, e, d=d)
    assert found.thinnest >= 0.98
    assert np.isfinite(found.speed)
