"""Component classes, their columns by name, and components as handles: before adoption, bound, after deletion."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from data.helpers_components import Charge, Everything
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, ForceSystem, NoPhysicsError, Phase, System, World, column
from carom.plugins.convex_polygon import ConvexPolygonCollider

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


def test_columns_of_bodies_by_name_and_by_kind():
    """Those of a component of one's own have a namespace; those of a kind are slices; writing goes into the array."""
    world = make_world()
    kinds = ["static", "dynamic", "kinematic", "dynamic", "static", "kinematic"]
    ids = [ball(world, 3.0 * x, kind=kind) for x, kind in enumerate(kinds)]
    world.add_component(ids[1], Charge(2.0))
    bodies = world.bodies
    for kind in ("dynamic", "kinematic", "static"):
        part = getattr(bodies, kind)
        assert part.entity.tolist() == [e for e, k in zip(ids, kinds, strict=True) if k == kind]
        assert part.has(Charge).tolist() == [e == ids[1] for e in part.entity.tolist()]
        assert np.shares_memory(part.mass, bodies.mass)
        assert part.mass.flags.c_contiguous
    assert not bodies.has(Everything).any()
    assert "charge" in dir(bodies)
    bodies.linear_velocity = (1.0, 2.0)
    bodies.mass += 1.0
    bodies.charge.value *= 3.0
    assert world.component_for_entity(ids[3], RigidBody).linear_velocity.tolist() == [1.0, 2.0]
    assert world.component_for_entity(ids[3], RigidBody).mass == 2.0
    assert bodies.dynamic.charge.value.tolist() == [6.0, 0.0]
    for x in range(100):  # the array has been reallocated: ``bodies`` must not hold the old one
        ball(world, 3.0 * x + 50.0)
    assert len(world.bodies.mass) == len(bodies.mass) == 106
    for name in ("speed", "charge"):
        with pytest.raises(AttributeError):
            setattr(bodies, name, 1.0)
    for name in ("entity", "kind"):
        with pytest.raises(ValueError, match="read-only"):
            setattr(bodies, name, 0)
    for columns, message in ((bodies, "no column 'colour'"), (bodies.charge, "charge")):
        with pytest.raises(AttributeError, match=message):
            _ = columns.colour


def values_of(handle):
    return {name: np.array(getattr(handle, name)).tolist() for name in handle.columns}


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("adopted", [False, True])
def test_a_component_holds_what_it_was_given_and_what_was_written_since(d, adopted):
    """Before it is bound and after; what is given is copied; columns and handles are two views of the same numbers."""
    world, push = make_world(d), np.array((1.0, 2.0, 3.0)[:d])
    everything = Everything(5.0, push=push)
    e = ball(world, 0.0)
    world.add_component(e, everything)
    push[:] = 9.0
    if adopted:
        assert len(world.bodies) == 1
    assert world.component_for_entity(e, Everything) is everything
    assert everything.entity == (e if adopted else None)
    expected = {
        "plain": 5.0, "count": 3, "on": False, "size": 1.0, "level": 0.0, "limit": None, "mode": "idle",
        "push": [1.0, 2.0, 3.0][:d], "facing": 0.0 if d == 2 else [1.0, 0.0, 0.0, 0.0],
    }  # fmt: skip
    assert values_of(everything) == expected
    changes = {"count": 7, "on": True, "limit": 2.5, "mode": "busy", "push": (4.0,) * d, "level": -1.5}
    for name, value in changes.items():
        setattr(everything, name, value)
    everything.push[0] = 3.0
    assert values_of(everything) == expected | changes | {"push": [3.0, 4.0, 4.0][:d]}
    columns = world.bodies.everything
    assert [columns.count.tolist(), columns.on.tolist(), columns.limit.tolist()] == [[7], [True], [2.5]]
    assert columns.push.tolist() == [everything.push.tolist()]
    assert columns.count.dtype == np.int64
    everything.limit = None
    assert everything.limit is None
    assert np.isnan(columns.limit[0])
    columns.push[0, 1] = 6.0
    assert everything.push[1] == 6.0


def test_coordinates_have_names():
    transform = Transform((1, 2), rotation=0.5)
    transform.y = 7
    assert (transform.x, transform.y, transform.position.tolist()) == (1.0, 7.0, [1.0, 7.0])
    assert repr(transform) == "Transform(position=[1.0, 7.0], rotation=0.5)"
    with pytest.raises(IndexError):
        _ = transform.z


class Player(Component):
    """Without slots: it may keep more than columns."""

    score = column(0, dtype=int)
    size = column(0.0, item="vector")

    def __init__(self, name):
        super().__init__(size=1.0)
        self.names, self.itself = [name], self


def pickled(handle):
    return pickle.loads(pickle.dumps(handle))


@pytest.mark.parametrize("do", [Component.copy, copy.copy, copy.deepcopy, pickled])
def test_copies_are_unbound_and_share_no_column(do):
    """A deep one shares nothing else either."""
    world = make_world()
    e = world.create_entity(Transform((0, 0)), RigidBody(), Player("Ada"))
    world.step()
    player, body = world.component_for_entity(e, Player), world.component_for_entity(e, RigidBody)
    player.score += 2
    body.apply_force((1.0, 0.0))
    twin = do(player)
    assert (twin.entity, player.entity) == (None, e)
    assert repr(twin) == repr(player)
    twin.size[0], player.score = 99.0, 3
    player.names.append("Bo")
    assert (player.size.tolist(), twin.score, world.bodies.player.score.tolist()) == ([1.0, 1.0], 2, [3])
    if do in (copy.deepcopy, pickled):
        assert twin.names == ["Ada"]
        assert twin.itself is twin
    assert do(body).applied_force.tolist() == [1.0, 0.0]
    shape = ((0.0, 0.0), (1.0, 0.0), (0.5, 0.8))
    polygon = do(ConvexPolygonCollider(shape, friction=0.5))
    assert (polygon.vertices.tolist(), polygon.friction) == ([list(corner) for corner in shape], 0.5)


@pytest.mark.parametrize("where", ["fresh", "adopted", "another world"])
def test_a_component_used_twice_is_an_error_that_says_copy(where):
    world, there = make_world(), make_world()
    body = RigidBody()
    first = (there if where == "another world" else world).create_entity(Transform((0, 0)), body)
    if where != "fresh":
        there.step()
        world.step()
    second = world.create_entity(Transform((1, 0)), body)
    known = "another world" if where == "another world" else f"RigidBody .*{first} and {second}"
    with pytest.raises(ValueError, match=rf"{known}.*copy\(\)"):
        world.step()
    if where == "another world":
        assert body.entity == first
        assert there.bodies.entity.tolist() == [first]
        there.close()  # then it can be used
    else:
        world.add_component(second, body.copy())
    world.step()
    assert second in world.bodies.entity


def test_static_bodies_are_read_only_but_for_assignment():
    world = make_world()
    e = world.create_entity(Transform((0, 0)), SphereCollider(1.0))
    transform = world.bodies and world.component_for_entity(e, Transform)
    with pytest.raises(ValueError, match="read-only"):
        transform.position[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        world.bodies.static.position[0, 0] = 1.0
    transform.position = (3, 4)
    assert world.bodies.static.position.tolist() == [[3.0, 4.0]]
    assert world.query_point((3.0, 4.5)) == [e]
    assert world.query_point((0.0, 0.0)) == []


@pytest.mark.compiled
def test_handles_stay_valid_through_growth_and_the_deletion_of_others():
    world = make_world()
    rng = np.random.default_rng(1)
    handles: dict[int, Transform] = {}
    for _ in range(30):
        for x in range(int(rng.integers(1, 30))):
            kind = ("dynamic", "kinematic", "static")[int(rng.integers(3))]
            e = ball(world, (100.0 * len(handles) + x, 5.0), kind=kind)
            handles[e] = world.component_for_entity(e, Transform)
            handles[e].y = e
        for e in rng.permutation(list(handles))[: int(rng.integers(0, 15))].tolist():
            del handles[e]
            world.delete_entity(e, immediate=bool(e % 2))
        world.step()
        assert sorted(world.bodies.entity.tolist()) == sorted(handles)
        for e, handle in handles.items():
            assert handle.entity == e
            assert handle.y == e
            assert handle.position.tolist() == world.bodies.position[world.bodies.row_of(e)].tolist()
    assert len(handles) > 64  # the tables have grown


def test_handles_of_deleted_entities_keep_their_last_values():
    world = make_world(dt=1.0)
    e, other = ball(world, (0.0, 1.0), (2.0, 0.0)), ball(world, (50.0, 0.0))
    world.step()
    transform, body = world.component_for_entity(e, Transform), world.component_for_entity(e, RigidBody)
    world.delete_entity(e)
    world.step()
    assert transform.entity is None
    assert transform.position.tolist() == [2.0, 1.0]
    assert (body.mass, body.kind) == (1.0, "dynamic")
    transform.x = -1.0  # unbound by now: no other body moves
    assert transform.x == -1.0
    assert world.bodies.position.tolist() == [[50.0, 0.0]]
    assert world.bodies.entity.tolist() == [other]
    again = world.create_entity(transform, body, SphereCollider(0.5))
    world.step()
    assert transform.entity == again
    assert transform.position.tolist() == [1.0, 1.0]


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
    with pytest.raises(AttributeError, match="did you mean 'linear_velocity'"):
        _ = world.bodies.linear_velocty
