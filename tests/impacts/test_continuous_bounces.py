"""Impacts on parabolas at the time of the closed form: a ball on a floor (B11), other geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_modes import along, mode_world, positions, rows_of, strikes, velocities
from helpers_pairwise import pairwise
from worlds import ball, box, floor, position, velocity

DT, G = 1 / 60, 9.81
# Methods whose path is the parabola: Verlet; event-driven flight with any integrator.
exact = pytest.mark.parametrize(
    ("mode", "integrator"), [("continuous", "velocity_verlet"), ("event_driven", "semi_implicit_euler")]
)


E_SWEEP = np.array([k / 10 for k in range(11)] + [1.5])
DROP = 4.9


def dropped(mode, integrator, **settings):
    """A ball of radius 0.1 (fast for its size) for each restitution, 4.9 m above the floor."""
    world = mode_world(mode, gravity=G, integrator=integrator, **settings)
    floor(world)
    return world, [ball(world, (2.0 * k, DROP + 0.1), radius=0.1, restitution=e) for k, e in enumerate(E_SWEEP)]


@exact
def test_b11_times_and_flights(mode, integrator):
    """Impact n at T0 (1 + 2 e (1 - e^(n-1)) / (1 - e)), flight n with the energy of h e^(2n), above 2 g dt."""
    world, balls = dropped(mode, integrator)
    t0, u = math.sqrt(2 * DROP / G), math.sqrt(2 * G * DROP)
    hits = strikes(world, 300)
    energy = velocities(world, balls)[:, 1] ** 2 / 2 + G * (positions(world, balls)[:, 1] - 0.1)
    for entity, e, now in zip(balls, E_SWEEP.tolist(), energy, strict=True):
        times = hits.time[hits.entity_b == entity]
        predicted, speeds = [t0], [u]
        while predicted[-1] + 2 * t0 * e ** len(predicted) < 5.0 and len(predicted) < 100:
            predicted.append(predicted[-1] + 2 * t0 * e ** len(predicted))
            speeds.append(speeds[-1] * e)
        sure = sum(speed > 1.05 * 2 * G * DT for speed in speeds)
        if e == 0:
            continue  # contacts of e = 0 may be left to the solver for contacts at rest
        np.testing.assert_allclose(times[:sure], predicted[:sure], rtol=1e-11)
        assert len(times) <= sum(speed > 0.95 * 2 * G * DT for speed in speeds)
        if sure == len(speeds):
            assert now == pytest.approx(G * DROP * e ** (2 * sure), rel=1e-11)


@pytest.mark.slow
@exact
def test_b11_zeno_without_a_threshold_ends(mode, integrator):
    """Threshold 0: infinitely many impacts in a finite time. The step stays bounded, nothing sinks, and they end."""
    world, balls = dropped(mode, integrator, restitution_threshold=0.0, max_impacts_per_step=8)
    balls, e = balls[:10], E_SWEEP[:10]
    over = math.sqrt(2 * DROP / G) * (1 + e) / (1 - e)
    rows = rows_of(world, balls)
    for step in range(1, int(over.max() / DT) + 60):
        world.step()
        impacts = world.contacts.impacts
        if len(impacts):
            counts = np.unique(impacts.entity_b, return_counts=True)[1]
            assert counts.max() <= 8
        heights = world.bodies.position[rows, 1] - 0.1
        assert heights.min() > -0.005 * 0.2
        late = step * DT > over + 4 * DT
        assert (np.abs(world.bodies.linear_velocity[rows, 1][late]) < G * DT).all()


@pytest.mark.parametrize("e", [0.1, 0.5, 0.9])
@exact
def test_what_only_just_closes_does_not_sink(mode, integrator, e):
    """Threshold 0: bodies that lie on the floor, or above it by rounding, and close by next to nothing. What holds them
    in a step is no reason to be let fall in the next one: no deeper than the slop."""
    world = mode_world(mode, gravity=G, integrator=integrator, restitution_threshold=0.0, max_impacts_per_step=8)
    floor(world)
    starts = [(gap, speed) for gap in (0.0, 3e-17, 8e-17, 1e-15, 1e-12) for speed in (1e-16, 2e-14, 1e-12, 1e-9, 1e-7)]
    balls = [
        ball(world, (float(k), 0.1 + gap), (0.0, -speed), radius=0.1, restitution=e)
        for k, (gap, speed) in enumerate(starts)
    ]
    for _ in range(10):
        world.step()
        assert positions(world, balls)[:, 1].min() > 0.1 - 0.005 * 0.2


# -- other parabolas -----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "dt", "target", "d"),
    pairwise(
        (("continuous", "velocity_verlet"), ("continuous", "rk4"), ("continuous", "yoshida4"), ("event_driven", "rk4")),
        (1.0, 1 / 60), ("floor", "ball", "face", "corner", "box on box"), (2, 3),
    ),
)  # fmt: skip
def test_parabolas_onto_static_geometry(method, dt, target, d):
    """Traced back 0.9 s from the touch, so time, normal and point are known; to 1e-12, in a single step of 1 s."""
    gravity, (mode, integrator) = np.array(along(d, 1.5, -G, 0.5)), method
    world = mode_world(mode, d, gravity, dt=dt, integrator=integrator, restitution_threshold=0.0)
    normal = np.array(along(d, 0.6, -0.8))  # from the body to the static shape
    if target in ("floor", "face", "box on box"):
        normal = np.array(along(d, 0.0, -1.0) if target == "floor" else along(d, 1.0))
    centre, size = np.array(along(d, 3.0, 2.0, 1.0)), 0.7
    if target == "ball":
        ball(world, centre, radius=size, kind="static")
        touch = centre - (size + 0.4) * normal
    elif target == "corner":
        box(world, centre, half=size, kind="static")
        touch = centre + size * np.array(along(d, -1.0, 1.0)) - 0.4 * normal  # in 3D the edge
    else:
        box(world, centre, half=size, kind="static")
        touch = centre - (size + 0.4) * normal + 0.3 * np.array(along(d, -normal[1], normal[0]))
    impact = np.array(along(d, 14.0, -11.0, 3.0))
    start, speed = touch - impact * 0.9 + gravity * 0.9**2 / 2, impact - gravity * 0.9
    shape = {"half": 0.4} if target == "box on box" else {"radius": 0.4}
    mover = (box if "half" in shape else ball)(world, start, speed, restitution=1.0, **shape)
    steps = round(1 / dt)
    hits = strikes(world, steps)
    assert hits.time.tolist() == pytest.approx([0.9], abs=1e-12)
    np.testing.assert_allclose(-hits.normal[0], normal, atol=1e-12)
    after = impact - 2 * (impact @ normal) * normal
    np.testing.assert_allclose(velocity(world, mover), after + gravity * 0.1, atol=1e-11)
    np.testing.assert_allclose(position(world, mover), touch + after * 0.1 + gravity * 0.005, atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "dt", "target", "d"), pairwise(("continuous", "event_driven"), (0.25, 1.0), ("ball", "box"), (2, 3))
)
def test_the_top_of_a_parabola_touches_a_ceiling(mode, dt, target, d):
    """An apex ``over`` too high meets the ceiling at (v0 - sqrt(2 g over)) / g, to 1e-16 over the speed there."""
    g, v0, top = 8.0, 0.88, 0.88**2 / 16
    for over in (1e-3, 1e-6, 1e-9, 1e-12, -1e-12, -1e-9):
        world = mode_world(mode, d, g, dt=dt, integrator="velocity_verlet", restitution_threshold=0.0)
        (ball if target == "ball" else box)(world, along(d, 0.0, top - over + 1.0), kind="static")
        ball(world, along(d), along(d, 0.0, v0), restitution=1.0)
        hits = strikes(world, 1)
        slow = math.sqrt(2 * g * max(over, 0.0))
        expected = [(v0 - slow) / g] if over > 0 else []
        assert hits.time.tolist() == pytest.approx(expected, abs=1e-15 / slow if expected else None), over
