"""The drawing list of any world: what is drawn is the shape that contacts see, where its body is."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest
from helpers_drawing import Gem, Pad, collider_of, create, crowd, groups_of, hull, polygon, reach_of, users

from carom import (
    AABBCollider,
    NoPhysicsError,
    Physics,
    Plugin,
    RigidBody,
    Settings,
    SphereCollider,
    Transform,
    World,
    column,
)  # fmt: skip
from carom.components import Collider
from carom.drawing import Drawing, Lines, Polygons, Style
from carom.framework.data.arrays.column import ArrayColumn
from carom.framework.plugins.checks import laws_of_outline, parameters_of
from carom.plugins import capsule, convex_hull, convex_polygon, half_space, terrain, tile_grid
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.joints import Distance, Joints
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.terrain import create_chain, create_triangle_mesh
from carom.plugins.tile_grid import TileGridCollider
from carom.systems.shapes.quaternions import axes_of

pytestmark = pytest.mark.plain
both = pytest.mark.parametrize("d", [2, 3])
SHIPPED = [
    (component, d)
    for plugin in (Physics(), capsule.plugin, convex_hull.plugin, convex_polygon.plugin, half_space.plugin,
                   terrain.plugin, tile_grid.plugin, Rotation())
    for component in plugin.shapes for d in component.dimensions
]  # fmt: skip


@pytest.mark.parametrize(("component", "d"), SHIPPED)
def test_outlines_of_shipped_shapes_obey_the_laws(component, d):
    broken = [law.said(0) for law in laws_of_outline("", component, [parameters_of(component, d)], d) if law.is_broken]
    assert broken == []


def fields_of(collider, axes):
    """What functions of its shape get, of a body with these axes."""
    d, values = len(axes), {}
    for name, column_ in type(collider).columns.items():
        value = getattr(collider, name)
        if name not in collider.stacked_columns:
            vector = not isinstance(column_, ArrayColumn) and column_.item == "vector"
            values[name] = tuple(np.broadcast_to(value, d).tolist()) if vector else value
    if type(collider).rotates:
        values["axes"] = tuple(map(tuple, axes.T.tolist()))
    return dataclasses.make_dataclass("Fields", values)(**values)


@pytest.mark.slow
@pytest.mark.compiled
@both
@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(k, marks=pytest.mark.long) for k in range(2, 12))])
def test_what_is_drawn_reaches_as_far_as_the_support(d, seed):
    """In random directions the farthest point that is drawn of a body is that of its support function; of what is
    round, or known by its support alone, a little less."""
    with crowd(d, seed) as world:
        shown, random = Drawing(world).update(), np.random.default_rng(seed)
        for row, entity in enumerate(world.bodies.entity.tolist()):
            collider = collider_of(world, entity)
            axes = axes_of(world.bodies.rotation[row : row + 1], d)[0]
            shape = fields_of(collider, axes)
            if isinstance(collider, AABBCollider):
                shape.half_extents = tuple(AABBCollider.turned(shape, axes)[0])
            rounding = type(collider).rounding(shape) if hasattr(collider, "rounding") else 0.0
            centre = world.bodies.position[row] + axes @ np.broadcast_to(collider.offset, d)
            for way in random.normal(size=(8, d)):
                way /= np.linalg.norm(way)
                wanted = centre @ way + np.dot(type(collider).support(shape, tuple(way)), way) + rounding
                exact = isinstance(collider, (SphereCollider, AABBCollider, BoxCollider, Gem)) or (
                    d == 3 and not isinstance(collider, Pad)
                )
                size = rounding if d == 2 else 1.0
                room = 1e-9 if exact else 0.03 * size + 1e-9
                assert -room <= reach_of(shown, entity, way) - wanted <= 1e-9, collider


def areas_of(group):
    """(n,) in a plane the areas of polygons, in space the volumes between faces and the centres of their shapes."""
    triangles = group.triangles().reshape(len(group), group.points.shape[1] - 2, 3, -1)
    if triangles.shape[3] == 2:
        (ax, ay), (bx, by) = (np.moveaxis(triangles[..., k, :] - triangles[..., 0, :], -1, 0) for k in (1, 2))
        return (ax * by - ay * bx).sum(axis=1) / 2.0
    a, b, c = np.moveaxis(triangles - group.centre[:, None, None], 2, 0)
    return (a * np.cross(b, c)).sum(axis=(1, 2)) / 6.0


@both
@pytest.mark.parametrize("seed", range(2))
def test_areas_and_volumes_are_those_of_the_moments(d, seed):
    random = np.random.default_rng((d, seed))
    half, plugin = random.uniform(0.2, 1.0, d), (convex_polygon.plugin if d == 2 else convex_hull.plugin)
    with World(Physics(dimensions=d), Rotation(), capsule.plugin, plugin, users) as world:
        colliders = {
            BoxCollider(half): 1e-12, AABBCollider(half): 1e-12, Gem(half[0]): 1e-12, Pad(half[0], half[1] / 9): 0.05,
            hull(random) if d == 3 else CapsuleCollider(*half): 1e-12 if d == 3 else 0.02,
            polygon(random) if d == 2 else hull(random): 0.01,
        }  # fmt: skip
        turn = random.normal() if d == 2 else random.normal(size=4)
        entities = [
            world.create_entity(Transform(np.zeros(d), 0.0 if isinstance(one, (AABBCollider, Gem)) else turn), one)
            for one in colliders
        ]
        shown = Drawing(world).update()
        for entity, collider in zip(entities, colliders, strict=True):
            own = [group.where(group.entity == entity) for group in shown.fixed if entity in group.entity]
            shape, room = fields_of(collider, np.eye(d)), colliders[collider]
            if isinstance(collider, AABBCollider):
                wanted = np.prod(2.0 * half)
            elif isinstance(collider, Gem):
                wanted = (2.0 * half[0]) ** d / (2.0 if d == 2 else 6.0)
            elif isinstance(collider, Pad):
                r, a = half[1] / 9, 2.0 * half[0]
                wanted = 2 * r * a + np.pi * r**2
                if d == 3:
                    wanted = 2 * r * a**2 + 2 * np.pi * r**2 * a + np.pi * r**3 * 4 / 3
            else:
                wanted = type(collider).second_moments(shape, d)[0]
            assert sum(areas_of(group).sum() for group in own) == pytest.approx(wanted, rel=room)


def flat(shown):
    """All arrays of a list."""
    groups = [*groups_of(shown), *shown.lines, *shown.points]
    return [getattr(group, each.name) for group in groups for each in dataclasses.fields(group)]


def change(world, random, what):
    """One thing that games do."""
    bodies, d = world.bodies, world.dimensions
    moving, still = bodies.entity[: bodies.kinematic.rows.stop].tolist(), bodies.static.entity.tolist()
    entity = int(random.choice(still if what in ("move static", "set static", "delete static") else moving))
    collider = collider_of(world, entity)
    if what.startswith("create"):
        create(world, random, what.removeprefix("create "))
    elif what.startswith("delete"):
        world.delete_entity(entity, immediate=True)
    elif what == "move static":
        world.component_for_entity(entity, Transform).position = random.normal(size=d)
    elif what == "set static":
        collider.sensor = not collider.sensor
        collider.offset = random.normal(size=d)
    elif what == "write sizes":
        for name in {"sphere_collider.radius", "box_collider.half_extents"}.intersection(bodies.column_names()):
            getattr(bodies, name)[: bodies.kinematic.rows.stop] *= 1.1
    elif what == "turn":
        world.component_for_entity(entity, Transform).rotation = random.normal() if d == 2 else random.normal(size=4)
    elif what == "another shape":
        world.remove_component(entity, type(collider))
        world.add_component(entity, SphereCollider(0.3, one_way=np.eye(d)[1]))


OPERATIONS = (
    "create dynamic", "create kinematic", "create static", "delete", "delete static", "move static", "set static",
    "write sizes", "turn", "another shape", "snapshot", "restore", "nothing",
)  # fmt: skip


@pytest.mark.slow
@both
@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(k, marks=pytest.mark.long) for k in range(2, 12))])
def test_a_list_that_follows_its_world_is_that_of_a_new_drawing(d, seed):
    random, kept = np.random.default_rng((d, seed, 1)), None
    with crowd(d, seed) as world:
        drawing = Drawing(world)
        before = drawing.update()
        for _ in range(30 if d == 2 else 10):
            what = str(random.choice(OPERATIONS))
            if what == "snapshot":
                kept = world.snapshot()
            elif what == "restore" and kept is not None:
                world.restore(kept)
            elif what not in ("nothing", "snapshot", "restore"):
                change(world, random, what)
            shown, fresh = drawing.update(), Drawing(world).update()
            for one, other in zip(flat(shown), flat(fresh), strict=True):
                np.testing.assert_array_equal(one, other)
            if what in ("delete", "turn", "write sizes", "nothing"):
                assert shown.fixed is before.fixed, what
            if what in ("move static", "set static", "create static", "delete static"):
                assert shown.fixed_version == before.fixed_version + 1, what
            assert (shown.fixed_version == before.fixed_version) == (shown.fixed_circles is before.fixed_circles)
            before = shown


@pytest.mark.compiled
@both
def test_bodies_are_drawn_between_two_steps(d):
    """A ball and a box that fall and turn, by a quarter of a step behind the last but one."""
    with World(Physics(dimensions=d, gravity=(0.0, -10.0, 0.0)[:d]), Rotation()) as world:
        spin = Spin(2.0, inertia=1.0) if d == 2 else Spin((0.0, 0.0, 2.0), inertia=(1.0, 1.0, 1.0))
        ball, moving = SphereCollider(0.5), RigidBody(linear_velocity=np.ones(d))
        box, half = Transform(3.0 * np.ones(d)), (2.0, 1.0, 1.0)[:d]
        ball = world.create_entity(Transform(np.zeros(d)), moving, ball, spin)
        box = world.create_entity(box, RigidBody(), BoxCollider(half), spin.copy())
        drawing, dt = Drawing(world), world.settings.dt
        world.advance(2.25 * dt)
        for interpolated, turn in ((True, 2.0 * 1.25 * dt), (False, 2.0 * 2.0 * dt)):
            shown, bodies = drawing.update(interpolated=interpolated), world.bodies
            place = (bodies.interpolated_position if interpolated else bodies.position)[bodies.rows_of([ball, box])]
            np.testing.assert_array_equal(shown.circles.centre, place[:1])
            (group,) = shown.polygons
            np.testing.assert_array_equal(group.centre, np.repeat(place[1:], len(group), axis=0))
            angle = shown.circles.angle[0]
            axis = angle[:2, 0] if d == 3 else np.array((np.cos(angle), np.sin(angle)))
            np.testing.assert_allclose(axis, (np.cos(turn), np.sin(turn)), rtol=0, atol=1e-9)
            far = group.points.reshape(-1, d) - place[1]
            assert (far[:, :2] @ axis).max() == pytest.approx(2.0, abs=1e-9)


def test_styles_tell_what_bodies_are():
    with World(Physics(2), Rotation()) as world:
        ball, box = SphereCollider(0.5), AABBCollider((0.5, 0.5))
        kinds = {
            Style.STATIC: world.create_entity(Transform((0, 0)), ball),
            Style.KINEMATIC: world.create_entity(Transform((2, 0)), RigidBody(kind="kinematic"), SphereCollider(0.5)),
            Style.DYNAMIC: world.create_entity(Transform((4, 0)), RigidBody(), box),
            Style.SENSOR: world.create_entity(Transform((6, 0)), RigidBody(), SphereCollider(0.5, sensor=True)),
            Style.ONE_WAY: world.create_entity(Transform((8, 0)), AABBCollider((1, 0), one_way=(0, 1))),
        }
        drawing = Drawing(world)
        shown = drawing.update()
        assert styles_of(shown) == {entity: style for style, entity in kinds.items()}
        assert np.isnan(shown.circles.angle).all()
        for style in (Style.STATIC, Style.KINEMATIC):  # what is off is not solid, whatever moves
            world.component_for_entity(kinds[style], SphereCollider).enabled = False
            assert styles_of(drawing.update())[kinds[style]] == Style.SENSOR


def styles_of(shown):
    return {e: s for g in groups_of(shown) for e, s in zip(g.entity.tolist(), g.style.tolist(), strict=True)}


@both
def test_what_is_static_is_made_once(d):
    """Whatever columns the first steps make, and whatever comes, moves, sleeps and goes."""
    with World(Physics(d, gravity=(0, -10, 0)[:d]), Rotation(), settings=Settings(sleeping=True)) as world:
        world.create_entity(Transform((0, -1, 0)[:d]), BoxCollider((10, 1, 1)[:d]))
        drawing = Drawing(world)
        first = drawing.update()
        for k in range(60):
            if k in (1, 50):
                falling = world.create_entity(Transform((0, 0.5, 0)[:d]), RigidBody(), SphereCollider(0.5), Spin())
            world.step()
            shown = drawing.update()
            assert (shown.fixed_version, shown.fixed is first.fixed) == (first.fixed_version, True)
        world.delete_entity(falling)
        world.step()
        assert drawing.update().fixed is first.fixed


@pytest.mark.compiled
def test_sleepers_are_told():
    with World(Physics(2, gravity=(0.0, -10.0)), settings=Settings(sleeping=True)) as world:
        world.create_entity(Transform((0, -1)), AABBCollider((5, 1)))
        for x in (0, 3):
            world.create_entity(Transform((x, 0.5)), RigidBody(), SphereCollider(0.5))
        drawing = Drawing(world)
        for _ in range(120):
            world.step()
        assert drawing.update().circles.style.tolist() == [Style.ASLEEP] * 2
        world.wake(2)
        world.step()
        circles = drawing.update().circles
        assert (circles.entity.tolist(), circles.style.tolist()) == ([3, 2], [Style.ASLEEP, Style.DYNAMIC])


def test_tiles_chains_and_meshes():
    with World(Physics(2), tile_grid.plugin, terrain.plugin) as world:
        tiles = world.create_entity(Transform((1, 2)), TileGridCollider([[1, 0, 1], [1, 1, 0]], 0.5))
        create_chain(world, [(0, 0), (1, 0), (2, 1)])
        drawing = Drawing(world)
        shown = drawing.update()
        assert sum(areas_of(group).sum() for group in shown.fixed) == pytest.approx(4 * 0.25)
        (lines,) = shown.fixed_lines
        np.testing.assert_array_equal(lines.points, [[(0, 0), (1, 0)], [(1, 0), (2, 1)]])
        assert drawing.update().fixed is shown.fixed
        world.component_for_entity(tiles, TileGridCollider).set((0, 1), 1)
        (group,) = drawing.update().fixed
        assert areas_of(group).tolist() == pytest.approx([2 * 0.25, 3 * 0.25])
        assert group.points.min(axis=(0, 1)).tolist() == [0.25, 1.5]
    with World(Physics(3), terrain.plugin) as world:
        create_triangle_mesh(world, [(0, 0, 0), (0, 0, 1), (1, 0, 0), (1, 0, 1)], [(0, 1, 2), (2, 1, 3)])
        (group,) = Drawing(world).update().fixed
        normals = np.cross(group.points[:, 1] - group.points[:, 0], group.points[:, 2] - group.points[:, 0])
        assert normals.tolist() == [[0, 1, 0], [0, 1, 0]]


def test_what_has_neither_outline_nor_support_is_its_box():
    plugin = Plugin("frames")

    @plugin.shape(cost=2)
    class Frame(Collider):
        size = column(positive=True)
        convex = False

        def bounds(shape, dimensions):
            return (shape.size, 2.0 * shape.size) if dimensions == 2 else (shape.size, 2.0 * shape.size, shape.size)

    for d, area in ((2, 8.0), (3, 16.0)):
        with World(Physics(d), plugin) as world:
            world.create_entity(Transform(np.zeros(d)), Frame(1.0))
            assert sum(areas_of(group).sum() for group in Drawing(world).update().fixed) == pytest.approx(area)


@both
def test_joints_contacts_velocities_and_boxes_are_drawn_over_the_shapes(d):
    joints = Joints()
    with World(Physics(d, gravity=(0.0, -10.0, 0.0)[:d]), Rotation(), joints) as world:
        floor = world.create_entity(Transform(np.zeros(d)), AABBCollider((9.0, 1.0, 9.0)[:d]))
        ball = world.create_entity(Transform((0.0, 1.49, 0.0)[:d]), RigidBody(), SphereCollider(0.5))
        other = world.create_entity(Transform((3.0, 4.0, 0.0)[:d]), RigidBody(), SphereCollider(0.5))
        rope = world.create_entity(Distance(None, other, point_a=(3.0, 7.0, 0.0)[:d]))
        drawing = Drawing(world)
        drawing.update(contacts=True, velocities=True, boxes=True)  # before any step
        world.step()
        shown = drawing.update(contacts=True, velocities=True, boxes=True, interpolated=False)
        joint, normal, velocity, box = (
            shown.lines_of(style) for style in (Style.JOINT, Style.NORMAL, Style.VELOCITY, Style.BOX)
        )
        assert joint.entity.tolist() == [rope]
        np.testing.assert_array_equal(joint.points, np.stack(joints.anchors(), axis=1))
        (contact,) = world.contacts
        assert normal.entity.tolist() == [min(floor, ball)]
        np.testing.assert_array_equal(normal.points[0, 0], contact.point)
        way = normal.points[0, 1] - normal.points[0, 0]
        np.testing.assert_allclose(way / np.linalg.norm(way), contact.normal, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(velocity.points[:, 0], world.bodies.position[: len(velocity)])
        for entity, place in ((ball, (0.0, 1.49, 0.0)[:d]), (other, (3.0, 4.0, 0.0)[:d])):
            own = box.points[box.entity == entity].reshape(-1, d)
            assert len(own) == (8 if d == 2 else 24)
            assert (own.min(axis=0) <= np.subtract(place, 0.49)).all()
            assert (own.max(axis=0) >= np.add(place, 0.49)).all()
        styles = [group.style[0] for group in shown.points]
        assert sorted(styles) == [Style.JOINT, Style.CONTACT]
        none = drawing.update(joints=False)
        assert (none.lines, none.points) == ([], [])


def test_a_frame_makes_no_object_per_body():
    """The number of Python's calls in a frame is that of a smaller world of the same shapes."""
    calls = []
    for count in (14, 140):
        with World(Physics(2), Rotation(), capsule.plugin) as world:
            for k in range(count):
                shape = (SphereCollider(0.4), BoxCollider((0.4, 0.2)), CapsuleCollider(0.2, 0.3))[k % 3]
                world.create_entity(Transform((2.0 * k, 0.0), 0.1), RigidBody(), shape, Spin(1.0, inertia=1.0))
            drawing, made = Drawing(world), []
            drawing.update()
            sys.setprofile(lambda frame, event, argument, made=made: made.append(event))
            drawing.update()
            sys.setprofile(None)
            calls.append(len(made))
    assert calls[0] == calls[1]


def test_lists_of_nothing():
    with World() as world, pytest.raises(NoPhysicsError):
        Drawing(world)
    for d in (2, 3):
        with World(Physics(d)) as world:
            world.create_entity(Transform(np.zeros(d)), RigidBody())
            shown = Drawing(world).update(contacts=True, velocities=False, boxes=False)
            assert len(shown) == 0


def test_triangles_of_polygons():
    square = Polygons(np.array([[(0.0, 0), (1, 0), (1, 1), (0, 1)]]), np.zeros(1, np.int8), np.array([7]))
    assert square.triangles().tolist() == [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]
    assert len(Lines(np.zeros((3, 2, 2)), np.zeros(3, np.int8), np.zeros(3, int)).where([0, 2])) == 2
