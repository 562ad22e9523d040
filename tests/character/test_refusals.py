"""What cannot be a character is refused, by name."""

from __future__ import annotations

import math

import pytest
from helpers_character import FIGURES, Stage, world_of

from carom import AABBCollider, CaromError, PartOf, RigidBody, SphereCollider, Spin, Transform, World
from carom.plugins import Physics
from carom.plugins.character import Character

pytestmark = pytest.mark.slow  # its kernels take long to compile

BODY = {"kind": "kinematic"}
REFUSED = ValueError, CaromError


def made(world, *components):
    """At the call, or at the next step of what cannot be known before."""
    world.create_entity(*components)
    world.step()


def test_what_cannot_be_a_character_is_refused_with_its_entity():
    half = AABBCollider((0.4, 0.4))
    place = Transform((0.0, 0.0))
    refused = {
        "no collider": (place, RigidBody(**BODY), Character()),
        "two colliders": (place, RigidBody(**BODY), half, SphereCollider(0.4), Character()),
        "static": (place, RigidBody(kind="static"), half.copy(), Character()),
        "no body": (place, half.copy(), Character()),
        "dynamic": (place, RigidBody(), half.copy(), Character()),
        "Spin": (place, RigidBody(**BODY), SphereCollider(0.4), Spin(), Character()),
    }
    for components in refused.values():
        world = world_of(2)
        with pytest.raises(REFUSED, match="Character"):
            made(world, *(each.copy() for each in components))
    world = world_of(2)
    body = world.create_entity(place.copy(), RigidBody(**BODY), half.copy())
    with pytest.raises(REFUSED, match="Character"):
        made(world, PartOf(body, (1.0, 1.0)), half.copy(), Character())


@pytest.mark.parametrize(
    "name",
    [
        "step_height", "snap", "skin", "acceleration", "air_acceleration", "gravity", "max_fall", "jump_speed",
        "jump_height", "jump_cut", "coyote", "buffer", "air_jumps", "wall_slide", "wall_jump", "wall_jump_up",
        "push_force", "weight", "max_slope",
    ],
)  # fmt: skip
def test_negative_settings_are_refused(name):
    with pytest.raises(ValueError, match=rf"Character\.{name}"):
        Character(**{name: -1})
    me = Character()
    with pytest.raises(ValueError, match=rf"Character\.{name}"):
        setattr(me, name, -1)


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ({"max_slope": 1.6}, "max_slope"), ({"up": (0, 0)}, "up"), ({"leave": "some"}, "leave"),
        ({"move": math.nan}, "move"), ({"jump_cut": 1.5}, "jump_cut"),
    ],
)  # fmt: skip
def test_settings_that_cannot_be_are_refused(values, name):
    with pytest.raises(ValueError, match=name):
        Character(**values)


def test_no_up_and_two_speeds_of_a_jump_are_refused():
    stage = Stage(FIGURES["capsule 3D"])
    with pytest.raises(ValueError, match=r"Character\.up"):
        stage.me.up = 0.0, 0.0, 0.0
    with pytest.raises(ValueError, match="jump_speed or a jump_height"):
        stage.character(0.0, 9.0, jump_speed=9.0, jump_height=1.0)


def test_a_forgotten_plugin_is_named_as_games_write_it():
    with pytest.raises(ValueError, match=r"Character does nothing without its plugin: World\(.*, Characters\(\)\)"):
        World(Physics(2)).create_entity(Transform((0, 0)), Character())
