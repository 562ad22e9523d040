"""Reference results in closed form for scenes of the library, computed without a step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from carom.framework import World
from carom.lab.measure.bodies import Floats, state_by_id
from carom.lab.measure.observer import RunResult
from carom.lab.testing.predict import bounce_times, collide, free_flight, impact_time, orbit_speed, spring

SAMPLES = 2000  # of a path, to find the largest displacement
Path = Callable[[float], Floats]  # maps seconds to positions (n, d)


def _seen(path: Path, seconds: float, world: World, struck: bool, times: list[float], **found: Any) -> RunResult:
    """What a run on this path would show. The energy is constant: all scenes here are conservative."""
    start = path(0.0)
    places = np.array([path(t) for t in np.linspace(0.0, seconds, SAMPLES)])
    energy = world.kinetic_energy() + world.potential_energy()
    found.setdefault("energy_scale", world.kinetic_energy())
    entities = sorted(world.bodies.dynamic.entity.tolist())
    return RunResult(
        path(seconds), entities=entities,
        reach=float(np.linalg.norm(places - start, axis=2).max()), energy=energy, energy_start=energy,
        impacts=len(times), times=times, struck=entities * struck, seconds=seconds, **found,
    )  # fmt: skip


def flight(world: World, seconds: float) -> RunResult:
    """Parabolas without contacts; the apex is v^2 / 2g."""
    _, x, v, _ = state_by_id(world)
    gravity = np.asarray(world.gravity, float)
    size = float(np.linalg.norm(gravity))
    rise = float((-(v @ gravity)).max() / size) if size else 0.0  # m/s, upwards
    apex = max(rise, 0.0) ** 2 / (2 * size) if size and rise < size * seconds else 0.0
    return _seen(lambda t: free_flight(t, x, v, gravity)[0], seconds, world, False, [], apex=apex)


def swinging(world: World, seconds: float) -> RunResult:
    """The undamped spring of the scene: x(t) = x0 cos(w t); at the centre all energy is kinetic."""
    _, x, v, mass = state_by_id(world)
    stiffness = world.force_systems[0].stiffness  # type: ignore[attr-defined]
    total = world.kinetic_energy() + world.potential_energy()
    return _seen(lambda t: spring(t, stiffness, mass[0], x, v)[0], seconds, world, False, [], energy_scale=total)


def kepler(world: World, seconds: float) -> RunResult:
    """An ellipse around the origin, GM = 1, from the perihelion on the x axis, by Kepler's equation M = E - e sin E."""
    _, x, v, _ = state_by_id(world)
    near, speed = float(x[0, 0]), float(v[0, 1])
    axis = 1 / (2 / near - speed**2)
    e = 1 - near / axis
    mean_motion = orbit_speed(1.0, axis) / axis

    def path(t: float) -> Floats:
        mean = mean_motion * t
        anomaly = mean + e * math.sin(mean)
        for _ in range(50):  # Newton's method; converges for e < 1
            anomaly -= (anomaly - e * math.sin(anomaly) - mean) / (1 - e * math.cos(anomaly))
        return axis * np.array([[math.cos(anomaly) - e, math.sqrt(1 - e * e) * math.sin(anomaly)]])

    return _seen(path, seconds, world, False, [])


def bounces(world: World, seconds: float) -> RunResult:
    """Elastic balls dropped from rest: each flight is the previous one mirrored in time."""
    _, x, _, mass = state_by_id(world)
    g = -float(np.asarray(world.gravity)[1])
    radius = 0.1
    fall = math.sqrt(2 * (float(x[0, 1]) - radius) / g)

    def path(t: float) -> Floats:
        since = math.remainder(t, 2 * fall)  # from an apex, between -fall and fall
        return x + np.array([0.0, -0.5 * g * since**2])

    times = [float(t) for t in bounce_times(float(x[0, 1]) - radius, g, 1.0, 1 + int(seconds / fall)) if t < seconds]
    scale = float(mass.sum()) * g * (float(x[0, 1]) - radius)
    every = sorted(times * len(x))
    return _seen(path, seconds, world, True, every, energy_scale=scale)


def one_impact(world: World, seconds: float) -> RunResult:
    """Two equal elastic discs of radius 1/2, as in the scene: straight lines with one corner each."""
    _, x, v, mass = state_by_id(world)
    when = impact_time(x[0], v[0], x[1], v[1], 1.0)
    touch = x + when * v
    normal = touch[1] - touch[0]
    after = np.array(collide(mass[0], v[0], mass[1], v[1], 1.0, normal))

    def path(t: float) -> Floats:
        return x + t * v if t < when else touch + (t - when) * after

    return _seen(path, seconds, world, True, [when])


FORMS: Mapping[str, Callable[[World, float], RunResult]] = {
    "jump": flight, "spring": swinging, "orbit": kepler, "bouncing": bounces, "oblique": one_impact,
}  # fmt: skip
