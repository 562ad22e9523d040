"""Compiling ahead: what bodies of some component types will need, and the queries.

The stages of a step are linked before it, so that only shapes and plugins can bring anything new. What queries and
force systems call compiles when it is called first: a small world of the same plugins and settings calls it here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..components import Collider, RigidBody, SphereCollider, Transform
from ..framework.data.bodies import SelectedBodies
from ..framework.data.component import Component
from ..framework.schedule.phases import ForceSystem
from ..framework.world.world import World
from .broad_phase.brute_force import BRUTE_FORCE_MAX
from .shapes.geometry_levels import in_order

if TYPE_CHECKING:
    from .simulation import Simulation

STEPS = 3  # contacts begin, stay and end
MANY = 4 * BRUTE_FORCE_MAX  # static bodies, more than move
LANE = 8.0  # m between things that are not to meet; samples of shapes are about one metre wide


def prepare(simulation: Simulation, world: World, components: tuple[type[Any], ...]) -> None:
    """Compile what bodies of these types will need beside those there are; TypeError for what is no component type.

    The world keeps to the functions of all these shapes from now on, whether bodies of each exist or not.
    """
    for component in components:
        if not (isinstance(component, type) and issubclass(component, Component)):
            raise TypeError(f"prepare takes component types, got {component!r}")
    table, registry, prepared = simulation.table, world.registry, simulation.scene.prepared
    wanted = {c for c in components if issubclass(c, Collider)}
    wanted.update(c for c in table.stacked_types(Collider.stack) if table.has_mask(c)[: table.count].any())
    in_order(registry, wanted)
    for component in sorted(wanted, key=lambda c: c.__name__):
        table.check_component_type(component)
        table.add_component_type(component)
    prepared |= wanted
    simulation.scene.forget()
    colliders = sorted(prepared, key=lambda c: c.__name__)
    fine = [c for c in colliders if c is not SphereCollider and in_order(registry, (c, SphereCollider))[1] is c]
    ccd = bool(table.column("ccd")[: table.stops[1]].any())
    with_levels = SphereCollider in colliders and bool(fine)
    for crowd, layered in ((0, False), (BRUTE_FORCE_MAX + 8, False), (0, True))[: 3 if with_levels else 2]:
        small = World(*world.plugins, settings=world.settings)
        small.physics.preparing = True  # type: ignore[union-attr]
        try:
            if crowd:
                small.add_system(_NoForce())
            _strike_and_rest(small, colliders, ccd)
            if colliders:
                _crowd(small, colliders[0], crowd)
            for collider in fine if layered else ():
                place = Transform(np.zeros(simulation.dimensions))
                small.create_entity(place, SphereCollider(LANE), collider.sample())
            for _ in range(STEPS):
                small.step()
            small.gravity = 0
            small.bodies.constant_force[:] = 0.0
            small.step()  # nothing acts
            _ask(small, colliders)
        finally:
            small.close()
    _evaluate_forces(simulation, world)


class _NoForce(ForceSystem):
    """With a force system of the game, integrators evaluate forces at every stage."""

    def add_forces(self, bodies: Any, time: float) -> None:
        pass


def _strike_and_rest(world: World, colliders: list[type[Collider]], ccd: bool) -> None:
    """Pairs of all shapes that meet within a step or overlap from the start: struck and bouncing, or pressed and held
    by friction; against all kinds of body. Where bodies are swept one is sent far, too, by a kinematic one."""
    d, speed = world.dimensions, 0.25 / world.settings.dt
    lane = 0
    for collider in colliders or [None]:
        for restitution in (0.0, 1.0):
            for kind in ("static", "kinematic", "dynamic"):
                for distance in (0.25, 0.5, 0.75, 1.0, 1.25):
                    lane += 1
                    here, there = np.zeros(d), np.zeros(d)
                    here[1] = there[1] = LANE * lane
                    there[0] = distance
                    towards = -np.eye(d)[0]
                    body = RigidBody(
                        linear_velocity=restitution * speed * towards, constant_force=10.0 * towards,
                        linear_damping=0.1, max_linear_speed=2.0 * speed, ccd=ccd,
                    )  # fmt: skip
                    for transform, mover in ((Transform(here), RigidBody(kind=kind)), (Transform(there), body)):
                        shape = [collider.sample(restitution=restitution, friction=0.5)] if collider else []
                        world.create_entity(transform, mover, *shape)
    for collider in colliders if ccd or world.settings.collision != "discrete" else ():
        lane += 1
        here, there = np.zeros(d), np.zeros(d)
        here[1] = there[1] = LANE * lane
        there[0] = 2.0
        racket = RigidBody(kind="kinematic", linear_velocity=100.0 * speed * np.eye(d)[0])
        for transform, body in ((Transform(here), racket), (Transform(there), RigidBody(ccd=ccd))):
            world.create_entity(transform, body, collider.sample(restitution=1.0))


def _crowd(world: World, collider: type[Collider], count: int) -> None:
    """So many moving bodies: enough for trees, of several levels because speeds differ. And static ones: as many, or,
    where none of these move, enough for a grid of them."""
    places = np.zeros((count or MANY, world.dimensions))
    behind, beside = np.divmod(np.arange(len(places)), count or 32)
    places[:, 0], places[:, 1] = 2.0 * LANE * (1 + beside), -2.0 * LANE * behind
    for index, place in enumerate(places):
        velocity = np.zeros(world.dimensions)
        velocity[1] = 4.0 ** (index % 6) / world.settings.dt
        if count:
            world.create_entity(Transform(place), RigidBody(linear_velocity=velocity), collider.sample())
        world.create_entity(Transform(place), collider.sample())


def _ask(world: World, colliders: list[type[Collider]]) -> None:
    """One query of each kind, of one and of many."""
    d = world.dimensions
    origin, ahead = np.zeros(d), np.eye(d)[0]
    points, ways = np.zeros((2, d)), np.ones((2, d))
    world.query_point(origin)
    world.query_sphere(origin, 1.0)
    world.query_aabb(origin, ahead + 1.0)
    world.query_spheres(points, 1.0)
    world.query_aabbs(points, points + 1.0)
    world.query_nearest(origin)
    world.query_nearests(points)
    world.neighbours(1.0)
    world.ray_cast(origin, ahead)
    world.ray_cast(origin, ahead, only_nearest=True)
    world.ray_casts(points, ways)
    for collider in colliders:
        shape = collider.sample()
        world.shape_cast(shape, origin, ahead)
        world.shape_cast(shape, origin, ahead, only_nearest=True)
        world.shape_casts(shape, points, ways)


def _evaluate_forces(simulation: Simulation, world: World) -> None:
    """Force systems of the game are pure: called for the bodies there are, they compile what they call.

    They get columns in place if all bodies have what they require, else copies that cannot be written: to numba two
    types.
    """
    if not world.force_systems:
        return
    dynamic, force = simulation.bodies.dynamic, simulation.table.make("force").copy()
    try:
        for system in world.force_systems:
            has = np.ones(len(dynamic), bool)
            for component in system.requires:
                has &= dynamic.has(component)
            if has.any() and has.all():
                system.add_forces(dynamic, world.time)
            if has.any():
                system.add_forces(SelectedBodies(simulation.table, np.flatnonzero(has)), world.time)
    finally:
        simulation.table.arrays["force"][...] = force
