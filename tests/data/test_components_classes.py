"""Component classes: constructor arguments, refused names, and their columns by name."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_components import Charge, Everything
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, column

pytestmark = pytest.mark.plain


@pytest.mark.parametrize("base", [Transform, RigidBody, SphereCollider, AABBCollider, Charge])
def test_component_classes_are_final(base):
    with pytest.raises(TypeError, match=f"{base.__name__} is final"):
        type("Derived", (base,), {})


def test_constructors_say_what_they_take():
    with pytest.raises(TypeError, match="needs a value for 'plain'"):
        Everything()
    with pytest.raises(TypeError, match=r"has no field 'colour'; it has plain, count"):
        Everything(1, colour=3)
    with pytest.raises(TypeError, match="twice"):
        Everything(1, plain=2)
    with pytest.raises(TypeError, match="takes 1 values"):
        Charge(1.0, 2.0)
    with pytest.raises(TypeError, match="copy"):
        type("Bad", (Component,), {"copy": column(0.0)})
    for wrong in ({"item": "matrix"}, {"dtype": str}):
        with pytest.raises(ValueError, match="column"):
            column(0.0, **wrong)


def test_classes_without_slots_may_keep_more_than_columns():
    class Player(Component):
        score = column(0, dtype=int)

        def __init__(self, name):
            super().__init__()
            self.name = name

    world = make_world()
    e = world.create_entity(Transform((0, 0)), RigidBody(), Player("Ada"))
    world.step()
    player = world.component_for_entity(e, Player)
    player.score += 1
    assert (player.name, world.bodies.player.score.tolist(), player.copy().name) == ("Ada", [1], "Ada")


def test_names_that_would_hide_others_are_refused_and_nothing_is_disturbed():
    world = make_world()
    e = ball(world, 0.0)
    world.step()
    for name in ("Charge", "Force", "Static", "Position"):
        clash = type(name, (Component,), {"value": column(0.0)})
        if name == "Charge":
            world.add_component(e, Charge(1.0))
            world.step()
        world.add_component(e, clash())
        with pytest.raises(ValueError, match=name):
            world.step()
        world.remove_component(e, clash)
        world.step()
    assert world.bodies.charge.value.tolist() == [1.0]


def test_columns_of_ones_own_have_a_namespace():
    world = make_world()
    charged, plain = ball(world, 0.0), ball(world, 5.0)
    world.add_component(charged, Charge(2.5))
    bodies = world.bodies
    assert bodies.charge.value.tolist() == [2.5, 0.0]
    assert bodies.has(Charge).tolist() == [True, False]
    assert bodies.dynamic.charge.value.tolist() == [2.5, 0.0]
    assert bodies.row_of(plain) == 1
    with pytest.raises(AttributeError, match="no column 'colour'"):
        _ = bodies.colour
    with pytest.raises(AttributeError, match="charge"):
        _ = bodies.charge.colour
    assert "charge" in dir(bodies)
    assert not bodies.has(Everything).any()


def test_assigning_to_a_column_writes_into_it():
    world = make_world()
    e = ball(world, 0.0)
    world.add_component(e, Charge(2.0))
    bodies = world.bodies
    bodies.linear_velocity = (1.0, 2.0)
    bodies.mass += 1.0
    bodies.charge.value *= 3.0
    assert world.component_for_entity(e, RigidBody).linear_velocity.tolist() == [1.0, 2.0]
    assert world.component_for_entity(e, RigidBody).mass == 2.0
    assert world.component_for_entity(e, Charge).value == 6.0
    for x in range(100):  # the array has been reallocated: ``bodies`` must not hold the old one
        ball(world, x + 5.0)
    assert len(world.bodies.mass) == len(bodies.mass) == 101
    with pytest.raises(AttributeError):
        bodies.speed = 1.0
    with pytest.raises(AttributeError):
        bodies.charge = 1.0
    for name in ("entity", "kind"):
        with pytest.raises(ValueError, match="read-only"):
            setattr(bodies, name, 0)


def test_the_kinds_are_contiguous_slices():
    world = make_world()
    kinds = ["static", "dynamic", "kinematic", "dynamic", "static", "kinematic"]
    ids = [ball(world, 3.0 * x, kind=kind) for x, kind in enumerate(kinds)]
    bodies = world.bodies
    for kind in ("dynamic", "kinematic", "static"):
        part = getattr(bodies, kind)
        assert part.entity.tolist() == [e for e, k in zip(ids, kinds, strict=True) if k == kind]
        assert len(part) == 2
        assert np.shares_memory(part.mass, bodies.mass)
        assert part.mass.flags.c_contiguous


def test_force_systems_cannot_lose_what_they_write_into_copies():
    from carom.framework import ForceSystem

    class Field(ForceSystem):
        requires = (Charge,)

        def add_forces(self, bodies, time):
            bodies.force += 2.0 * bodies.charge.value[:, None]
            with pytest.raises(ValueError, match="read-only"):
                bodies.charge.value[:] = 0.0

    world = make_world(dt=1.0)
    charged, _plain = ball(world, 0.0), ball(world, 5.0)
    world.add_component(charged, Charge(1.5))
    world.add_system(Field())
    world.step()
    assert world.bodies.linear_velocity.tolist() == [[3.0, 3.0], [0.0, 0.0]]
