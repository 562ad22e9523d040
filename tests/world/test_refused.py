"""What is nearly right is refused where it is written, with the name that was probably meant, or told with its cure."""

from __future__ import annotations

import threading
import warnings
from typing import ClassVar

import numpy as np
import pytest
from worlds import ball, make_world

from carom.components import AABBCollider, Collider, RigidBody, SphereCollider, Transform
from carom.framework import (
    CaromError,
    Component,
    ForceSystem,
    NoPhysicsError,
    PhysicsWarning,
    Plugin,
    PluginError,
    Settings,
    StepError,
    System,
    UnhandledPairError,
    World,
    column,
)
from carom.plugins import Physics, capsule, rotation
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.rotation import Rotation, Spin
from carom.plugins.springs import Springs
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


REFUSED = {
    "plugin class": (lambda: World(Physics(dimensions=2), Rotation), TypeError, "did you mean Rotation()?"),
    "plugin module": (lambda: World(Physics(dimensions=2), rotation), TypeError, "mean rotation.Rotation()?"),
    "module of a plugin": (lambda: make_world(2).add_plugin(capsule), TypeError, "did you mean capsule.plugin?"),
    "iterations": (lambda: Settings(iterations=10), TypeError, "did you mean 'substeps'"),
    "event": (lambda: make_world(2).on("contact_started", print), ValueError, "did you mean 'contact_begin'"),
    "own event": (lambda: make_world(2).on("level_up", print), ValueError, "world.events.define('level_up')"),
    "attribute": (misspelt_gravity, AttributeError, "did you mean 'gravity'"),
    "plain value": (plain_value, TypeError, "Health.hp = 10 is no column: write hp = column(10)"),
    "annotated value": (annotated_value, TypeError, "Health.hp = 10 is no column"),
    "default": (default_of_another_shape, ValueError, "Health.hp must be one scalar"),
    "no physics": (body_without_physics, NoPhysicsError, "entity 1 has RigidBody"),
    "turning": (lambda: RigidBody(angular_velocity=1), TypeError, "that of a Spin turns bodies"),
    "moment": (lambda: RigidBody(moment=1), TypeError, "that of a Spin turns bodies"),
    "moment of a Spin": (lambda: Spin(moment=1), TypeError, "did you mean 'inertia'?"),
    "sphere": (lambda: SphereCollider(1, bounce=1), TypeError, "did you mean 'restitution'"),
    "many": (lambda: SphereCollider.many(1, bounce=1), TypeError, "did you mean 'restitution'"),
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


@pytest.mark.parametrize("case", REFUSED)
def test_it_is_refused_with_the_near_name(case):
    act, error, text = REFUSED[case]
    with pytest.raises(error) as caught:
        act()
    assert text in str(caught.value)


@pytest.mark.parametrize("requires", [(), (SphereCollider,)], ids=["all bodies", "some bodies"])
@pytest.mark.parametrize("shape", [(3,), (7, 2)])
def test_forces_of_a_wrong_shape_name_the_system_and_both_shapes(requires, shape):
    class Wind(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force = np.ones(shape)

    Wind.requires = requires
    world = make_world(2)
    ball(world, (0, 0))
    world.create_entity(Transform((9, 9)), RigidBody())
    world.add_system(Wind())
    with pytest.raises(StepError) as caught:
        world.step()
    bodies = 1 if requires else 2
    assert f"in force system Wind: ValueError: bodies.force has shape ({bodies}, 2), got shape {shape}" in str(
        caught.value
    )


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


def test_worlds_are_stepped_in_one_thread_at_a_time():
    """Another thread gets an error and changes nothing; afterwards it may step."""
    inside, leave = threading.Event(), threading.Event()

    class Waits(System):
        def process(self, dt):
            inside.set()
            assert leave.wait(10)

    first, second = make_world(2), make_world(2)
    first.add_system(Waits())
    thread = threading.Thread(target=first.step)
    thread.start()
    assert inside.wait(10)
    try:
        for step in (second.step, lambda: second.advance(1.0)):
            with pytest.raises(CaromError, match="another thread"):
                step()
    finally:
        leave.set()
        thread.join()
    assert (first.step_count, second.step_count) == (1, 0)
    second.step()
    assert second.step_count == 1


def test_a_body_in_no_layer_is_refused():
    world = make_world(2)
    collider = world.component_for_entity(ball(world, (0, 0)), SphereCollider)
    for make in (
        lambda: SphereCollider(1.0, layer=0), lambda: setattr(collider, "layer", 0),
        lambda: world.create_entities(
            2, Transform.many(np.zeros((2, 2))), AABBCollider.many((1.0, 1.0), layer=np.array([2, 0]))
        ),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"layer must not be 0.*mask=0"):
            make()
    collider.layer, collider.mask = -(2**63), 0
    assert len(world.bodies) == 1


def test_frames_in_milliseconds_are_told_once():
    world = make_world(2)
    world.advance(3.0)  # somebody has dragged the window
    world.advance(0.016)
    world.advance(16)
    with pytest.warns(PhysicsWarning, match=r"advance takes seconds.*milliseconds / 1000"):
        world.advance(17)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        world.advance(16)
    assert len(world.faults) == 1


def test_a_shape_of_carom_without_its_plugin_names_it():
    world = make_world(2)
    world.create_entity(Transform((0, 0)), RigidBody(), CapsuleCollider(0.2, 0.2))
    with pytest.raises(UnhandledPairError, match=r"capsule\.plugin"):
        world.step()


def test_springs_before_physics_say_in_which_order():
    with pytest.raises(NoPhysicsError, match=r"before them: World\(Physics"):
        World(Springs(), Physics())


def test_arrays_keep_their_last_values_when_the_world_closes():
    world = make_world(2)
    for x in range(100):
        ball(world, (2.0 * x, 0), (1.0, 2.0))
    position, velocity = world.bodies.position, world.bodies.dynamic.linear_velocity
    before = position.copy()
    world.close()
    np.testing.assert_array_equal(position, before)
    assert (velocity == (1.0, 2.0)).all()
