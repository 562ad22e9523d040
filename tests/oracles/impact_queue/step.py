"""The oracle's step, and its comparison with the world's."""

from __future__ import annotations

import itertools

import numpy as np

from carom.framework import World
from carom.lab.measure.body_shapes import Floats

from .bodies import Pair, bodies_of, touch
from .impacts import Impact, Impacts

INTEGRATORS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet")
SAME_PLACE = 1e-9  # of the size: a smaller gap counts as none


class Oracle:
    """A copy of a small world between two steps, which :meth:`step` advances; ValueError for what it does not know."""

    def __init__(self, world: World) -> None:
        self.settings = world.settings
        self._method = "flight" if self.settings.collision == "event_driven" else self.settings.integrator
        foreign = [system.name for system in world.systems if system.parts() is None]
        foreign += [system.name for system in world.force_systems]
        if foreign or self._method not in (*INTEGRATORS, "flight"):
            raise ValueError(f"the oracle does not know {', '.join(foreign) or self._method}")
        self._gravity = np.array(world.gravity, float)
        self.bodies = bodies_of(world)
        self.pairs: list[Pair] = []  # of the last step
        self.impacts: list[Impact] = []  # of the last step, in order

    def step(self) -> None:
        """Take one step of ``settings.dt``."""
        dynamic = [body for body in self.bodies if body.inverse_mass > 0.0]
        acts = self._gravity.any() or any(b.rigid.linear_damping or np.any(b.rigid.constant_force) for b in dynamic)
        curved = bool(acts) and self._method in ("velocity_verlet", "flight")
        sweeping = self.settings.collision != "discrete" or any(body.rigid.ccd for body in dynamic)
        for body in self.bodies:
            body.fly(self.settings.dt, self._gravity, self._method, curved)
        both = itertools.combinations(self.bodies, 2)
        self.pairs = [Pair(a, b) for a, b in both if not a.rigid.kind == b.rigid.kind == "static"]
        impacts = Impacts(self.pairs, self.settings, curved, sweeping)
        impacts.run()
        self.impacts = impacts.done

    def contacts(self) -> dict[tuple[int, int], float]:
        """The impulses (N s) of pairs that had one, or touch at the end of the step, or crossed each other in it."""
        found = {}
        for pair in self.pairs:
            depth = touch(pair.a, pair.b, pair.between(pair.a.position, pair.b.position)).depth
            if pair.impulse > 0.0 or pair.crossed or depth >= (-SAME_PLACE * pair.size if pair.pushes else 0.0):
                found[pair.key] = pair.impulse
        return found


def assert_agrees(world: World, oracle: Oracle, tolerance: float = 1e-9) -> None:
    """The world and its oracle are in the same state, after the same impacts in the last step; AssertionError names the
    first difference.

    tolerance
        relative to the scene's scales: the step, the largest coordinate, speed and impulse of moving bodies
    """
    bodies, dt = world.bodies, oracle.settings.dt
    moving = [body for body in oracle.bodies if body.rigid.kind != "static"]
    speed = max([*(float(np.abs(b.velocity).max()) + b.gained for b in moving), 1e-300])
    place = max([*(float(np.abs(b.position).max()) + b.size for b in moving), speed * dt])
    heaviest = max([*(body.rigid.mass for body in moving if body.rigid.kind == "dynamic"), 1e-300])
    now = oracle.contacts()
    push = max([*now.values(), heaviest * speed])

    def check(what: str, name: str, got: object, expected: Floats | float, scale: float) -> None:
        off, limit = float(np.abs(np.asarray(got) - expected).max()), tolerance * scale
        assert off <= limit, f"{what}: {name} is {got}, the oracle says {expected}: {off:.3g} apart, limit {limit:.3g}"

    struck = world.contacts.impacts
    pairs = list(zip(struck.entity_a.tolist(), struck.entity_b.tolist(), strict=True))
    expected = [impact.pair.key for impact in oracle.impacts]
    assert pairs == expected, f"impacts are {pairs}, the oracle says {expected}"
    for row, impact in enumerate(oracle.impacts):
        what = f"impact of {impact.pair.a.entity} and {impact.pair.b.entity}"
        check(what, "time_of_impact", struck.time_of_impact[row], impact.time, dt)
        check(what, "normal", struck.normal[row], impact.normal, 1.0)
        check(what, "normal_impulse", struck.normal_impulse[row], impact.impulse, push)
    for body in moving:
        row = bodies.row_of(body.entity)
        check(f"entity {body.entity}", "position", bodies.position[row], body.position, place)
        check(f"entity {body.entity}", "linear_velocity", bodies.linear_velocity[row], body.velocity, speed)
    found = world.contacts
    pairs = list(zip(found.entity_a.tolist(), found.entity_b.tolist(), strict=True))
    assert pairs == sorted(now), f"contacts are {pairs}, the oracle says {sorted(now)}"
    for row, pair in enumerate(pairs):
        check(f"contact of {pair[0]} and {pair[1]}", "normal_impulse", found.normal_impulse[row], now[pair], push)
