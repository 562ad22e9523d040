"""The quantities of free flight: step length, stiffness, duration, distance from the origin, sizes.

Each measurement builds a world whose motion is known in closed form, steps it, and returns the relative error.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import closing
from typing import Any

import numpy as np

from carom.components import RigidBody, Transform
from carom.framework import ForceSystem, World
from carom.lab import testing as kit
from carom.plugins import Physics
from carom.systems.integration.integrators import STANDARD_INTEGRATORS

from .edges import BY_MODE, BrokenError, Method, Quantity, by_integrator, decades

GRAVITY = 10.0  # m/s^2
TAKE_OFF = 5.0  # m/s: a jump of one second
FREQUENCY = 2 * math.pi  # rad/s: one oscillation per second
MOST_STEPS = 1000
SWINGS = 10
FEWEST_STEPS = 100  # of an oscillation: growth needs time to be visible
BLOWN_UP = 1e6  # times the energy at the start
SHORT_SWING = 0.1  # z of the spring in the long run
TEN_SWINGS, TEN_BOUNCES = 628, 1073  # steps of ten oscillations and ten bounces, over which the energy is averaged
SPEED = 1.0  # m/s, of bodies that meet head on


class PullOrDrag(ForceSystem):
    """A spring to the origin, in N/m, and a force opposite to the velocity, in N s/m."""

    def __init__(self, stiffness: float = 0.0, drag: float = 0.0) -> None:
        self.stiffness, self.drag = stiffness, drag

    def add_forces(self, bodies: Any, time: float) -> None:
        bodies.force[:] -= self.stiffness * bodies.position + self.drag * bodies.linear_velocity


def new_world(method: Method, gravity: float = 0.0, **settings: Any) -> World:
    """An empty 2D world."""
    return World(Physics(dimensions=2, gravity=(0.0, -gravity)), settings=method.settings(**settings))


def jump(method: Method, dt: float) -> float:
    """A body thrown upwards, against v t - g t^2 / 2, for one jump but at most a thousand steps."""
    with closing(new_world(method, GRAVITY, dt=dt)) as world:
        world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(0, TAKE_OFF)))
        steps = min(max(round(2 * TAKE_OFF / GRAVITY / dt), 1), MOST_STEPS)
        t = dt * np.arange(1, steps + 1)
        true = TAKE_OFF * t - GRAVITY / 2 * t * t
        found = np.empty(steps)
        position = world.bodies.position
        for n in range(steps):
            world.step()
            found[n] = position[0, 1]
    top = TAKE_OFF**2 / (2 * GRAVITY) if t[-1] * GRAVITY >= TAKE_OFF else 0.0
    return float(np.abs(found - true).max() / max(np.abs(true).max(), top))


def swing(method: Method, dt: float) -> float:
    """A body pushed off on a spring, against sin(w t), for ten periods, at least 100 and at most 1,000 steps."""
    steps = min(max(round(SWINGS * 2 * math.pi / FREQUENCY / dt), FEWEST_STEPS), MOST_STEPS)
    t = dt * np.arange(1, steps + 1)
    true = np.sin(FREQUENCY * t)
    found = _swung(method, dt, FREQUENCY, 0.0, FREQUENCY, steps)[:, 0]
    return float(np.abs(found - true).max() / np.abs(true).max())


def stiffness(method: Method, z: float) -> float:
    """A body released on a spring of z = w dt, a thousand steps: the largest change of the energy."""
    states = _swung(method, 1.0, z, 1.0, 0.0, MOST_STEPS)
    energy = (states**2 @ (z * z, 1.0)) / (z * z)
    return float(np.abs(energy - 1).max())


def drag(method: Method, ratio: float) -> float:
    """A body slowed by a drag force, against exp(-c t), a thousand steps."""
    with closing(new_world(method, dt=1.0)) as world:
        world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(SPEED, 0)))
        world.add_system(PullOrDrag(drag=ratio))
        velocity, worst = world.bodies.linear_velocity, 0.0
        for n in range(1, MOST_STEPS + 1):
            world.step()
            worst = max(worst, abs(float(velocity[0, 0]) / SPEED - math.exp(-ratio * n)))
            if not worst < BLOWN_UP:
                raise BrokenError("speed grows")
    return worst


def _swung(method: Method, dt: float, frequency: float, x: float, v: float, steps: int) -> np.ndarray:
    """(steps, 2): position and velocity on a spring; BrokenError once the energy has grown a millionfold."""
    states = np.empty((steps, 2))
    with closing(new_world(method, dt=dt)) as world:
        world.create_entity(Transform((x, 0)), RigidBody(linear_velocity=(v, 0)))
        world.add_system(PullOrDrag(frequency**2))
        highest = BLOWN_UP * ((frequency * x) ** 2 + v * v)
        position, velocity = world.bodies.position, world.bodies.linear_velocity
        for n in range(steps):
            world.step()
            states[n] = position[0, 0], velocity[0, 0]
            if not (frequency * states[n, 0]) ** 2 + states[n, 1] ** 2 < highest:
                raise BrokenError("energy grows")
    return states


def long_swing(method: Method, steps: float) -> float:
    """Drift of the mean energy of a spring of z = 0.1, from the first steps to the last."""
    with closing(new_world(method, dt=1.0)) as world:
        world.create_entity(Transform((1, 0)), RigidBody())
        world.add_system(PullOrDrag(SHORT_SWING**2))
        x, v = world.bodies.position, world.bodies.linear_velocity
        return _drift(world, round(steps), TEN_SWINGS, lambda: SHORT_SWING**2 * x[0, 0] ** 2 + v[0, 0] ** 2)


def long_bounce(method: Method, steps: float) -> float:
    """Drift of the mean energy of an elastic ball that falls four metres, at 60 steps a second."""
    with closing(new_world(method, GRAVITY)) as world:
        kit.floor(world)
        kit.ball(world, (0, 4.5), restitution=1.0)
        x, v = world.bodies.position, world.bodies.linear_velocity
        return _drift(world, round(steps), TEN_BOUNCES, lambda: GRAVITY * (x[0, 1] - 0.5) + v[0, 1] ** 2 / 2)


def _drift(world: World, steps: int, window: int, energy: Callable[[], float]) -> float:
    """The relative change of the mean energy between the first window of steps and the last."""
    window = min(window, steps // 2)
    means = []
    for skipped in (0, steps - 2 * window):
        kit.run(world, skipped)
        total = 0.0
        for _ in range(window):
            world.step()
            total += energy()
        means.append(total / window)
    return abs(means[1] / means[0] - 1)


def distance(method: Method, offset: float) -> float:
    """Two balls of 1 m meet head on at this distance from the origin: the error of their positions after 0.5 s."""
    with closing(new_world(method)) as world:
        for side in (-1, 1):
            kit.ball(world, offset + 0.6 * side, -SPEED * side, restitution=1.0)
        start = world.bodies.position.copy()
        kit.run(world, 30)
        position, velocity = world.bodies.position.copy(), world.bodies.linear_velocity.copy()
    if (position == start).all():
        raise BrokenError("nothing moves: a step is less than the spacing of the numbers")
    if not velocity[0, 0] < 0 < velocity[1, 0]:
        raise BrokenError("they pass through each other")
    travel = 30 / 60 * SPEED
    true = offset + np.array([-1, 1]) * (0.5 + (travel - 0.1))
    return float(np.abs(position[:, 0] - true).max() / travel)


def sizes(method: Method, ratio: float) -> float:
    """A small ball hits a large one of the same mass and stops; the large one moves on."""
    small, large = ratio**-0.5, ratio**0.5
    gap, steps = 0.1, 12
    with closing(new_world(method)) as world:
        kit.ball(world, -small - gap, SPEED, radius=small, restitution=1.0)
        kit.ball(world, large, radius=large)
        kit.run(world, steps)
        position, velocity = world.bodies.position.copy(), world.bodies.linear_velocity.copy()
    travel = steps / 60 * SPEED
    true = np.array([-small, large + travel - gap])
    return max(
        float(np.abs(position[:, 0] - true).max() / travel), float(np.abs(velocity[:, 0] - (0, SPEED)).max() / SPEED)
    )


INTEGRATORS = by_integrator(tuple(STANDARD_INTEGRATORS))
LONG_RUNS = tuple(method for method in INTEGRATORS if method.name != "explicit_euler")  # its long runs diverge
STEPS = decades(3, 5)

QUANTITIES = (
    Quantity(
        "dt", "step, of a jump", "s", "height of a jump of one second, of the greatest height",
        decades(-9, -4) + decades(-3, 1, 2), 1e-4, INTEGRATORS, jump, quick=(1e-9, 1e-4, 1e-2, 1, 10),
    ),
    Quantity(
        "dt-spring", "step, of a spring", "s", "place on a spring that swings once a second, of the amplitude",
        decades(-9, -4) + decades(-3, 1, 2), 1e-4, INTEGRATORS, swing, quick=(1e-9, 1e-4, 1e-2, 0.1, 1),
    ),
    Quantity(
        "stiffness", "stiffness x dt", "z = w dt", "energy of a spring over 1,000 steps, of that at the start",
        (*decades(-2, 0, 4), 1.25, 1.5, 1.75, 1.99, 2.5, 3.0), 0.01, INTEGRATORS, stiffness, fine=1.01,
        quick=(0.01, 0.1, 1.0, 1.99, 3.0),
    ),
    Quantity(
        "drag", "drag x dt", "c dt", "speed of a body that a force brakes, of that at the start",
        (*decades(-2, 0, 4), 1.25, 1.5, 1.75, 1.99, 2.5, 3.0), 0.01, INTEGRATORS, drag, fine=1.01,
        quick=(0.01, 0.1, 1.0, 1.99, 3.0),
    ),
    Quantity(
        "duration", "duration, of a spring", "steps", "drift of the mean energy of a spring of z = 0.1",
        STEPS, STEPS[0], LONG_RUNS, long_swing, fine=None, whole=True, quick=STEPS[:1], long=(1e6,),
    ),
    Quantity(
        "bounces", "duration, of a bouncing ball", "steps", "drift of the mean energy of an elastic ball",
        STEPS, STEPS[0], (
            *BY_MODE, Method("continuous with velocity_verlet",
                             {"collision": "continuous", "integrator": "velocity_verlet"}),
        ), long_bounce, fine=None, whole=True, quick=STEPS[:1], long=(1e6,),
    ),
    Quantity(
        "distance", "distance from the origin", "m", "place of balls that meet head on, of the way they go",
        decades(0, 16), 1.0, BY_MODE, distance, quick=(1.0, 1e9, 1e12, 1e15, 1e16),
    ),
    Quantity(
        "size", "ratio of sizes", "", "place and speed of a small ball and a large one that meet, of way and speed",
        decades(0, 32)[::2], 1.0, BY_MODE, sizes, quick=(1.0, 1e18, 1e32),
    ),
)  # fmt: skip
