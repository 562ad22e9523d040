"""Names that are nearly right are refused with the one that was meant; what is meant is taken."""

from __future__ import annotations

from typing import ClassVar

import pytest
from worlds import make_world

from carom import Physics, RigidBody, Rotation, Settings, SphereCollider, Spin, Transform, World
from carom.components import AABBCollider, Collider
from carom.framework import Component, NoPhysicsError, Plugin, PluginError, column
from carom.plugins import capsule, rotation
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.tile_grid import TileGridCollider

TILES = ((1, 0), (1, 1))


def misspelt_gravity():
    make_world(2).gravty = (0, -10)


def plain_value():
    class Health(Component):
        hp = 10


def annotated_value():
    class Health(Component):
        hp: int = 10


def default_of_another_shape():
    class Health(Component):
        hp = column(default=[1, 2])


def body_without_physics():
    world = World()
    world.create_entity(Transform((0, 0)), RigidBody())
    world.step()


def bare(name):
    def decorate():
        decorator = getattr(Plugin("mine"), name)

        @decorator
        class Thing(Collider):
            pass

    return decorate


def set_to_one(component, name):
    setattr(component, name, 1.0)


NEAR = {
    "plugin class": (lambda: World(Physics(dimensions=2), Rotation), TypeError, "did you mean Rotation()?"),
    "plugin module": (lambda: World(Physics(dimensions=2), rotation), TypeError, "mean rotation.Rotation()?"),
    "module of a plugin": (lambda: make_world(2).add_plugin(capsule), TypeError, "did you mean capsule.plugin?"),
    "iterations": (lambda: Settings(iterations=10), TypeError, "did you mean 'substeps'"),
    "settings": (lambda: set_to_one(make_world(2).settings, "dt"), AttributeError, "world.settings.replace(dt=1.0)"),
    "event": (lambda: make_world(2).on("contact_started", print), ValueError, "did you mean 'contact_begin'"),
    "own event": (lambda: make_world(2).on("level_up", print), ValueError, "world.events.define('level_up')"),
    "attribute": (misspelt_gravity, AttributeError, "did you mean 'gravity'"),
    "plain value": (plain_value, TypeError, "Health.hp = 10 is no column: write hp = column(10)"),
    "annotated value": (annotated_value, TypeError, "Health.hp = 10 is no column"),
    "default": (default_of_another_shape, ValueError, "Health.hp must be one scalar"),
    "no physics": (body_without_physics, NoPhysicsError, "entity 1 has RigidBody"),
    "moment": (lambda: RigidBody(moment=1), TypeError, "that of a Spin turns bodies"),
    "moment of a Spin": (lambda: Spin(moment=1), TypeError, "did you mean 'inertia'?"),
    "sphere": (lambda: SphereCollider(1, bounce=1), TypeError, "did you mean 'restitution'"),
    "capsule": (lambda: CapsuleCollider(1, 1, bounciness=1), TypeError, "did you mean 'restitution'"),
    "tiles": (lambda: TileGridCollider(TILES, 1.0, bounce=1), TypeError, "did you mean 'restitution'"),
    "box": (lambda: AABBCollider(size=(1, 1)), TypeError, "did you mean 'half_extents'"),
    "body": (lambda: RigidBody(velocity=(1, 0)), TypeError, "did you mean 'linear_velocity'"),
    **{
        f"{read.__name__} {wrong}": (
            lambda read=read, made=made, wrong=wrong: read(made, wrong), AttributeError, f"did you mean '{right}'"
        )
        for made, wrong, right in (
            (RigidBody(), "velocity", "linear_velocity"), (RigidBody(), "apply_forse", "apply_force"),
            (Transform((0, 0)), "pos", "position"), (SphereCollider(1.0), "bounce", "restitution"),
        )
        for read in (getattr, set_to_one) if (read, wrong) != (set_to_one, "apply_forse")
    },
    "twice": (
        lambda: make_world(2).create_entity(Transform((0, 0)), RigidBody(), Transform((1, 1))),
        ValueError, "one component of each type, got 2 Transform",
    ),
    **{
        name: (bare(name), PluginError, f"plugin mine: {name} on Thing takes arguments: @plugin.{name}(")
        for name in ("shape", "pair", "sweep", "integrator", "broad_phase", "mixing_rule")
    },
}  # fmt: skip


@pytest.mark.parametrize("case", NEAR)
def test_it_is_refused_with_the_near_name(case):
    act, error, text = NEAR[case]
    with pytest.raises(error) as caught:
        act()
    assert text in str(caught.value)


def test_what_is_meant_is_taken():
    """Constants, methods and markers of components; events that were declared; attributes of one's own worlds."""

    class Health(Component):
        MOST = 100.0
        kinds: ClassVar[tuple[str, ...]] = ("red", "blue")
        points: float = column(default=MOST)

        @property
        def dead(self):
            return self.points == 0

    class Game(World):
        score: int

    game, heard = Game(Physics(2)), []
    game.score = 3
    game.events.define("level_up")
    game.on("level_up", heard.append)
    game.dispatch_event("won", 1)
    game.on("won", heard.append)
    game.dispatch_event("level_up", 2)
    assert (Health().points, Health().dead, game.score, heard) == (100.0, False, 3, [2])
    with pytest.raises(AttributeError, match="did you mean 'gravity'"):
        game.gravty = 1
