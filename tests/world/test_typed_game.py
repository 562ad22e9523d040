"""The game that ``make typecheck`` reads runs; and what worlds and bodies say of themselves."""

from __future__ import annotations

import inspect

import typed_game
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import System, World


def test_the_typed_game_runs_twice_alike():
    first, second = typed_game.play(), typed_game.play()
    assert first == second
    assert first[1] > 0
    assert len(typed_game.colliders()) == 15


def test_what_is_wrong_there_is_wrong_when_it_runs():
    """Each line of ``mistakes`` raises."""
    lines = [line.strip() for line in inspect.getsource(typed_game.mistakes).splitlines()[1:]]
    assert len(lines) == 11
    for line in lines:
        try:
            exec(line, vars(typed_game))
        except (TypeError, ValueError):
            continue
        raise AssertionError(line)


def test_worlds_and_bodies_tell_name_dimensions_counts_and_time():
    world = World(name="the moon")
    assert repr(world) == "<World 'the moon', no physics; 0 entities; step 0, 0 s>"
    world.close()
    world = make_world(3)
    world.create_entity(Transform((0, 0, 0)), AABBCollider(1.0))
    ball(world, (0, 5, 0))
    world.create_entity(Transform((0, 9, 0)), RigidBody(kind="kinematic"), SphereCollider(0.5))
    world.create_entity("no body")
    inside = []

    class Says(System):
        def process(self, dt):
            inside.append(repr(self.world))

    world.add_system(Says())
    for _ in range(30):
        world.step()
    counts = "1 dynamic, 1 kinematic, 1 static"
    assert repr(world) == f"<World {world.name!r}, 3D, bodies: {counts}; 4 entities; step 30, 0.5 s>"
    assert inside[0] == f"<World {world.name!r}, 3D, bodies: {counts}; 4 entities; step 0, 0 s>"
    assert repr(world.bodies).startswith(f"<3 bodies in 3D: {counts}; 0.5 s; columns ")
    assert repr(world.bodies.static).startswith("<1 static bodies in 3D; 0.5 s; columns ")
    world.close()
    assert repr(world) == f"<World {world.name!r}, closed>"
