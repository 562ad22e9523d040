"""Columns of components before the first body has one."""

from __future__ import annotations

import esper
import pytest
from worlds import ball, make_world

from carom.components import SphereCollider, Transform
from carom.framework import CaromError, Component, ForceSystem, NoPhysicsError, Phase, System, World, column
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.capsule import plugin as capsule

pytestmark = pytest.mark.plain


class Bullet(Component):
    expires: float = column(default=3.0)


@pytest.mark.parametrize("how", ["register", "prepare", "a body", "a batch"])
def test_columns_are_there_from_the_moment_the_world_knows_the_component(how):
    world = make_world(2)
    with pytest.raises(AttributeError, match=r"no column 'bullet'.*world\.register"):
        _ = world.bodies.bullet
    if how in ("register", "prepare"):
        getattr(world, how)(Bullet)
        assert world.bodies.bullet.expires.shape == (0,)
    bullet = ball(world, (0, 0))
    other = ball(world, (9, 0))
    if how == "a batch":
        world.create_entities(1, Transform.many((5, 5)), SphereCollider.many(1.0), Bullet.many(7.0))
    else:
        world.add_component(bullet, Bullet(7.0))
    assert sorted(world.bodies.bullet.expires.tolist())[-1] == 7.0
    assert world.bodies.has(Bullet).sum() == 1
    if how != "a batch":
        assert world.bodies.bullet.expires[world.bodies.row_of(other)] == 3.0


def test_a_system_reads_columns_before_the_first_body_has_them():
    """A force system is called once a body has what it requires."""
    seen = []

    class Ages(System):
        phase = Phase.START

        def process(self, dt):
            seen.append(self.world.bodies.bullet.expires.tolist())

    class Pull(ForceSystem):
        requires = (Bullet,)

        def add_forces(self, bodies, time):
            bodies.force[:, 0] += bodies.bullet.expires

    world = make_world(2)
    world.register(Bullet)
    world.add_system(Ages())
    world.add_system(Pull())
    world.step()
    world.add_component(ball(world, (0, 0)), Bullet(1.0))
    world.step()
    assert seen == [[], [1.0]]
    assert world.momentum()[0] == pytest.approx(world.settings.dt)


def test_registering_changes_no_bit():
    """A component and a collider that nobody has: the same hash after the same steps, before and after others come."""
    worlds = [make_world(2, gravity=-9.81) for _ in range(2)]
    for world in worlds:
        world.add_plugin(capsule)
    worlds[1].register(Bullet, CapsuleCollider)
    for world in worlds:
        ball(world, (0, 0), kind="static")
        ball(world, (0.3, 2.0))
        for k in range(60):
            if k == 30:
                world.add_component(ball(world, (0.1, 5.0)), Bullet())
            world.step()
    assert worlds[0].state_hash() == worlds[1].state_hash()


def test_what_cannot_be_registered_is_refused():
    class Mass(Component):
        prefix_taken: float = column(default=0.0)

    world = make_world(2)
    with pytest.raises(TypeError, match="register takes component types"):
        world.register(Bullet())
    with pytest.raises(ValueError, match="bodies have mass already"):
        world.register(Mass)
    with pytest.raises(NoPhysicsError):
        World().register(Bullet)
    errors = []

    class Registers(System):
        def process(self, dt):
            with pytest.raises(CaromError) as caught:
                self.world.register(Bullet)
            errors.append(str(caught.value))

    world.add_system(Registers())
    with world:
        esper.process(world.settings.dt)
    assert errors == ["components can be registered between steps only, not inside one"]
    with pytest.raises(AttributeError, match="did you mean 'linear_velocity'"):
        _ = world.bodies.linear_velocty
