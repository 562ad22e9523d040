"""Pictures of ``carom run``: final state, paths, and parts of them."""

from __future__ import annotations

import json
from pathlib import Path

import helpers_cli
import numpy as np
import pytest
from helpers_cli import refusal, report_of
from helpers_drawing import Gem, users
from helpers_processes import run_python
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from PIL import Image

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.drawing import Drawing, Style
from carom.framework import Settings, World
from carom.lab.measure.run import FEW_BODIES, FEW_STEPS, run
from carom.lab.pictures.projection import Projection
from carom.lab.pictures.run_pictures import GHOSTS, Still, draw_final, draw_run, draw_traces, find_view
from carom.plugins import Physics, capsule, convex_hull, convex_polygon, half_space, tile_grid
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_hull import ConvexHullCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.half_space import HalfSpaceCollider
from carom.plugins.joints import Distance, Joints
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.tile_grid import TileGridCollider

carom, ball = helpers_cli.carom, helpers_cli.ball  # fixtures


@pytest.mark.slow
def test_run_prints_the_tables_and_draws_two_pictures(carom, tmp_path):
    result = carom("run", "billiards", "--seconds", "0.3", "--out", "pictures")
    assert result.exit_code == 0, result.stderr
    expected = (
        "billiards", "16 dynamic", "contacts", "energy", "deepest overlap", "escaped",
    )  # fmt: skip
    for word in (*expected, "BroadPhase", "whole step"):
        assert word in result.stdout
    for name in ("billiards-final.png", "billiards-traces.png"):
        picture = tmp_path / "pictures" / name
        assert str(Path("pictures") / name) in result.stdout
        assert picture.read_bytes().startswith(b"\x89PNG")
        assert picture.stat().st_size > 10_000


@pytest.mark.slow
def test_the_picture_of_the_paths_alone_and_a_part_of_it(carom, tmp_path):
    whole = report_of(carom("run", "shots", "--out", "new/whole.png", "--json"))
    part = report_of(carom("run", "shots", "--out", "part.png", "--view", "-1,-1.2,16,2.2", "--json"))
    assert whole["state_hash"] == part["state_hash"]
    assert [whole["pictures"], part["pictures"]] == [[str(Path("new") / "whole.png")], ["part.png"]]
    assert {path.name for path in tmp_path.rglob("*.*")} == {"whole.png", "part.png"}
    shapes = []
    for name in ("new/whole.png", "part.png"):
        header = (tmp_path / name).read_bytes()[:24]
        assert header.startswith(b"\x89PNG")
        shapes.append((int.from_bytes(header[16:20]), int.from_bytes(header[20:24])))
    assert shapes[0][1] > 0.8 * shapes[0][0]
    assert shapes[1][1] < 0.4 * shapes[1][0]  # as wide and flat as the part is


@pytest.mark.slow
def test_a_recording_shows_every_third_step_and_changes_none(carom, tmp_path):
    plain = report_of(carom("run", "jump", "--steps", "30", "--no-pictures", "--json"))
    for name in ("film.gif", "new/film.webp"):
        report = report_of(carom("run", "jump", "--steps", "30", "--record", name, "--no-pictures", "--json"))
        assert report["pictures"] == [str(Path(name))]
        assert report["state_hash"] == plain["state_hash"]
        with Image.open(tmp_path / name) as film:
            assert film.n_frames == 11
            first = np.asarray(film.convert("RGB"), int)
            film.seek(10)
            assert np.abs(np.asarray(film.convert("RGB"), int) - first).max() > 50
            assert film.info["duration"] == 50


def test_a_recording_of_another_kind_is_refused_before_the_run(carom):
    line = refusal(carom("run", "billiards", "--record", "film.avi"))
    assert "--record: a film has a name that ends in .mp4, .gif, .webp, not film.avi" in line


@pytest.mark.parametrize("view", ["0,0,4", "0,0,4,x", "4,3,0,0", "0,0,4,inf", "0,0,1e308,1e308", "-1e101,0,1,1"])
def test_a_view_that_is_none_is_refused(carom, view):
    assert "is not a lower and an upper corner" in refusal(carom("run", "jump", "--view", view))


def test_a_view_of_another_dimension_is_refused(carom):
    assert "view has 3 dimensions, the world 2" in refusal(carom("run", "jump", "--view", "0,0,0,4,4,4"))


@pytest.mark.slow
def test_3d_is_drawn_too(carom, tmp_path, ball):
    text = ball.read_text().replace("dimensions=2", "dimensions=3").replace("-9.81)", "-9.81, 0.0)")
    text = (
        text.replace("(0, 0)", "(0, 0, 0)")
        .replace("(seed, 10)", "(seed, 10, 0)")
        .replace("(50, 0.5)", "(50, 0.5, 50)")
    )
    box = "    world.create_entity(Transform((3, 5, 1)), RigidBody(), AABBCollider(half_extents=(1, 0.5, 2)))"
    ball.write_text(text.replace("    return world", f"{box}\n    return world"))
    filmed = carom("run", "ball.py", "--steps", "30", "--record", "ball.webp", "--json")
    if "drawn by OpenGL" in filmed.stderr:
        pytest.skip(filmed.stderr)
    report = report_of(filmed)
    assert report["dimensions"] == 3
    assert [Path(p).name for p in report["pictures"]] == ["ball-final.png", "ball-traces.png", "ball.webp"]
    assert all((tmp_path / p).is_file() for p in report["pictures"])


@pytest.mark.slow
def test_without_matplotlib_the_run_goes_on_and_says_what_is_missing(tmp_path):
    code = "import sys; sys.modules['matplotlib'] = None; import carom.lab.cli.main as c; c.main()"
    result = run_python(code, "run", "jump", "--steps", "2", "--json", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "carom[plot]" in result.stderr
    assert json.loads(result.stdout)["pictures"] == []


def test_pictures_into_a_file_are_refused_before_the_run(carom, tmp_path):
    (tmp_path / "out").write_text("in the way")
    assert "--out" in refusal(carom("run", "jump"))


@pytest.mark.slow
def test_an_empty_world_is_drawn_too(carom, tmp_path):
    for dimensions in (2, 3):
        text = (
            "from carom.framework import World\nfrom carom.plugins import Physics\n"
            f"def build(settings, seed=0):\n    return World(Physics(dimensions={dimensions}), settings=settings)\n"
        )
        (tmp_path / "empty.py").write_text(text)
        report = report_of(carom("run", "empty.py", "--steps", "3", "--json"))
        assert all((tmp_path / p).is_file() for p in report["pictures"])
        assert "no bodies" in carom("run", "empty.py", "--steps", "3").stdout


def test_bodies_created_on_the_way_and_kinematic_ones_are_traced():
    world = World(Physics(dimensions=2, gravity=(0.0, 0.0)))
    lift = world.create_entity(Transform((0, 0)), RigidBody(kind="kinematic", linear_velocity=(0, 1)))
    world.create_entity(Transform((9, 0)), RigidBody())  # does not move
    created = []

    def create(step: int) -> None:
        if step == 5:
            created.append(world.create_entity(Transform((3, 3)), RigidBody(linear_velocity=(5, 0))))

    traces = run(world, 10, after_step=create).traces
    assert traces.entities.tolist() == sorted([lift, *created])
    assert traces.moved == 2
    world.close()


def test_a_short_run_keeps_the_corners_of_its_paths():
    """A ball to and fro between two walls, a box against a wall: the turning points, and the paths through them."""
    settings = Settings(collision="continuous")
    with World(Physics(dimensions=2, gravity=(0.0, 0.0)), settings=settings) as world:
        for x in (-1.75, 1.75):
            world.create_entity(Transform((x, 0)), AABBCollider((0.5, 5), restitution=1.0))
        ball = world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(120, 0)), SphereCollider(0.25))
        box = world.create_entity(Transform((0, 3)), RigidBody(linear_velocity=(75, 0)), AABBCollider((0.25, 0.25)))
        traces = run(world, 2).traces
    world.close()
    impacts = traces.impacts or []
    # The ball, which goes 2 in a step, turns 1 to the right, then 1 to the left; the box to the right, a little later.
    assert [(impact.after, len(impact.centres)) for impact in impacts] == [(1, 1), (1, 0), (2, 1)]
    struck = [(impact.centres[ball][0], impact.after) for impact in impacts if ball in impact.centres]
    np.testing.assert_allclose(struck, [(1, 1), (-1, 2)], rtol=0, atol=1e-12)
    assert not any(box in impact.centres for impact in impacts)
    assert traces.entities.tolist() == [ball, box]  # moved, though it is back where it was at the end of each step
    np.testing.assert_allclose(traces.positions[:, 0, 0], [0, 0, 0], rtol=0, atol=1e-6)
    path = traces.corners[:, 0, 0]
    np.testing.assert_allclose(path[np.abs(np.diff(path, append=9)) > 1e-6], [0, 1, 0, -1, 0], rtol=0, atol=1e-6)


@pytest.mark.parametrize(("bodies", "steps"), [(FEW_BODIES + 1, 2), (1, FEW_STEPS + 1)])
def test_longer_runs_and_larger_worlds_are_not_followed_step_by_step(bodies, steps):
    with World(Physics(dimensions=2, gravity=(0.0, 0.0))) as world:
        places = [(2.0 * k, 0.0) for k in range(bodies)]
        world.create_entities(bodies, Transform.many(places), RigidBody.many(linear_velocity=(1.0, 0.0)))
        traces = run(world, steps).traces
    world.close()
    assert traces.impacts is None
    np.testing.assert_array_equal(traces.corners, traces.positions)


# -- one list for all ----------------------------------------------------------------------------------------------


def marks_of(sheet):
    """What matplotlib has of a sheet: polygons by their corners, ellipses by centre and width, lines; sorted."""
    polygons, circles, lines = [], [], []
    for one in sheet.axes.collections:
        if isinstance(one, PolyCollection):
            polygons += [path.vertices[:-1].ravel().tolist() for path in one.get_paths()]
        elif isinstance(one, EllipseCollection):
            circles += np.column_stack((one.get_offsets(), one.get_widths())).tolist()
        elif isinstance(one, LineCollection):
            lines += [line.ravel().tolist() for line in one.get_segments()]
    return sorted(polygons), sorted(circles), sorted(lines)


def test_pictures_draw_what_the_drawing_list_holds():
    """Every polygon and circle of the list to the bit, and a joint, in the picture of the final state; windows and
    films are compared with it in tests/view."""
    pentagon = ConvexPolygonCollider.regular(5, 0.5)
    shapes = SphereCollider(0.5), BoxCollider((0.5, 0.2)), CapsuleCollider(0.2, 0.4), pentagon
    plugins = Joints(), capsule.plugin, convex_polygon.plugin
    with World(Physics(dimensions=2, gravity=(0.0, -10.0)), Rotation(), *plugins) as world:
        for k in range(12):
            body = () if k > 8 else (RigidBody(linear_velocity=(1.0, k)), Spin(0.3 * k))
            world.create_entity(Transform((2.0 * k, 0.0), 0.4 * k), *body, shapes[k % 4].copy())
        world.create_entity(Distance(1, 2))
        drawing = Drawing(world)
        done = run(world, 5)
        still = Still.of(drawing)
        shown = drawing.update(interpolated=False)
        projection = Projection.of(*find_view(still, done.traces))
        groups = (*shown.polygons, *shown.fixed)
        polygons = sorted(points.ravel().tolist() for group in groups for points in group.points)
        discs = shown.circles, shown.fixed_circles
        circles = sorted(row for each in discs for row in np.column_stack((each.centre, 2 * each.radius)).tolist())
        (joint,) = shown.lines_of(Style.JOINT).points
        assert (len(polygons), len(circles)) == (9, 3)
        found = marks_of(draw_final(done, still, projection, projection.frame()))
        assert found[:2] == (polygons, circles)
        assert joint.ravel().tolist() in found[2]


def test_the_shape_of_a_user_is_drawn():
    """A diamond that says nothing of what it looks like, from a plugin of a game."""
    with World(Physics(dimensions=2, gravity=(0.0, 0.0)), users) as world:
        world.create_entity(Transform((0, 0)), RigidBody(), Gem(1.0))
        colour_at = final_picture(world, 0, (-2, -2), (2, 2))
    for place, seen in (((0.0, 0.9), True), ((0.45, 0.45), True), ((0.55, 0.55), False), ((-0.9, 0.2), False)):
        assert (np.abs(colour_at(place) - colour_at((-1.9, -1.9))).max() > 50) == seen, place


# -- what turns ----------------------------------------------------------------------------------------------------


def colours_of(sheet):
    """A function: the colour (3,) that the picture has at a place."""
    picture = sheet.pixels(100)

    def colour_at(place):
        x, y = sheet.axes.transData.transform(place)
        return picture[len(picture) - 1 - int(y), int(x)].astype(int)

    return colour_at


def final_sheet(world, steps, lower, upper):
    done = run(world, steps)
    projection = Projection.of(np.asarray(lower, float), np.asarray(upper, float))
    return draw_final(done, Still.of(Drawing(world)), projection, projection.frame()), projection


def final_picture(world, steps, lower, upper):
    return colours_of(final_sheet(world, steps, lower, upper)[0])


@pytest.mark.slow
def test_the_mark_of_a_ball_turns_with_it():
    """Two balls side by side: one has turned by 2.5 rad and has a line there; one has no Spin and is plain."""
    with World(Physics(dimensions=2, gravity=(0.0, 0.0)), Rotation()) as world:
        world.create_entity(Transform((0, 0)), RigidBody(), Spin(2.5), SphereCollider(1.0))
        world.create_entity(Transform((4, 0)), RigidBody(), SphereCollider(1.0))
        colour_at = final_picture(world, 60, (-2, -2), (6, 2))
    plain = colour_at((4, -0.5))
    marked = []
    for angle in np.linspace(0, 2 * np.pi, 60, endpoint=False) + 2.5:
        direction = np.array([np.cos(angle), np.sin(angle)])
        np.testing.assert_array_equal(colour_at((4, 0) + 0.7 * direction), plain)
        marked.append(np.abs(colour_at(0.7 * direction) - plain).max() > 50)
    assert marked[0]
    assert sum(marked) <= 3  # the line alone, with its neighbours


@pytest.mark.slow
def test_what_turns_is_drawn_as_it_is_turned():
    """A box, a capsule and a square of 4 by 1 or so, turned by 60 degrees: inside and outside, along and across."""
    plugins = capsule.plugin, convex_polygon.plugin
    shapes = {
        0: BoxCollider((2, 0.5)),
        8: CapsuleCollider(0.5, 1.5),
        16: ConvexPolygonCollider([(-1.5, 0), (1.5, 0), (0, 0.3)], corner_radius=0.5),
        24: BoxCollider((2, 0.5), offset=(1, 0)),
    }
    with World(Physics(dimensions=2, gravity=(0.0, 0.0)), Rotation(), *plugins) as world:
        for x, shape in shapes.items():
            upright = np.pi / 2 if isinstance(shape, CapsuleCollider) else 0.0
            body = RigidBody(kind="kinematic")
            world.create_entity(Transform((x, 0), rotation=upright), body, Spin(np.pi / 3), shape)
        colour_at = final_picture(world, 60, (-4, -4), (30, 4))
    along = np.array([0.5, np.sqrt(0.75)])
    across = np.array([-along[1], along[0]])
    for x in shapes:
        centre = np.array((x, 0.0)) + (along if x == 24 else 0.0)
        inside = [centre, centre + 1.8 * along, centre - 1.8 * along, centre - 0.4 * across]
        outside = [centre + 2.2 * along, centre - 2.2 * along, centre - 0.7 * across, centre + np.array((1.8, 0))]
        body, background = colour_at(centre), colour_at((x + 4, -3))
        assert np.abs(body - background).max() > 50
        for place in inside:
            np.testing.assert_array_equal(colour_at(place), body)
        for place in outside:
            np.testing.assert_array_equal(colour_at(place), background)


def test_tile_maps_half_spaces_and_one_way_platforms_are_drawn():
    plugins = half_space.plugin, tile_grid.plugin
    with World(Physics(dimensions=2, gravity=(0.0, 0.0)), *plugins) as world:
        world.create_entity(Transform((0, 0)), HalfSpaceCollider((1, 2)))
        world.create_entity(Transform((2, 4)), AABBCollider((1, 0), one_way=(0, 1)))
        world.create_entity(Transform((5.5, 2), rotation=0.3), TileGridCollider([[1, 0, 1], [1, 1, 0]], 1.0))
        sheet, _ = final_sheet(world, 0, (-2, -2), (8, 6))
    colour_at = colours_of(sheet)
    air, wall = colour_at((0, 3)), colour_at((4.5, 1.5))
    assert np.abs(wall - air).max() > 10
    for place in ((5.5, 1.4), (4.5, 2.5), (6.5, 2.5), (0, -0.1), (1.6, -0.9), (-1.6, 0.7)):
        np.testing.assert_array_equal(colour_at(place), wall)
    for place in ((5.5, 2.5), (6.5, 1.5), (3.8, 2), (0, 0.1), (1.6, -0.7), (-1.6, 0.9)):
        np.testing.assert_array_equal(colour_at(place), air)
    outlines = [path.vertices for part in sheet.axes.collections for path in part.get_paths()]
    assert any(len(outline) >= 2 and set(map(tuple, outline)) == {(1, 4), (3, 4)} for outline in outlines)


@pytest.mark.slow
def test_the_repeated_shapes_of_a_path_are_turned_as_they_were():
    """A disc that rolls: the point of its rim that was in front is on a cycloid."""
    with World(Physics(dimensions=2, gravity=(0.0, 0.0)), Rotation()) as world:
        world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(1, 0)), Spin(-1.0), SphereCollider(1.0))
        done = run(world, 180)
        projection = Projection.of(np.array((-2.0, -2.0)), np.array((6.0, 2.0)))
        sheet = draw_traces(done, Still.of(Drawing(world)), projection, projection.frame())
    hands = [
        line for part in sheet.axes.collections if isinstance(part, LineCollection) for line in part.get_segments()
    ]
    rims = [line for line in hands if len(line) == 2 and np.isclose(np.linalg.norm(line[1] - line[0]), 1.0)]
    assert len(rims) == GHOSTS
    for centre, rim in rims:
        turned = centre[0]
        np.testing.assert_allclose(rim, (turned + np.cos(turned), -np.sin(turned)), rtol=0, atol=1e-5)


# -- in space ------------------------------------------------------------------------------------------------------

LOWER, UPPER = np.array((-12.0, -9.0, -12.0)), np.array((12.0, 9.0, 12.0))
RIGHT, UP, TOWARD = Projection.of(LOWER, UPPER).axes


def facing(angle):
    """The quaternion of a body whose z axis points towards the camera, turned by that angle in the picture."""
    along = np.cos(angle) * RIGHT + np.sin(angle) * UP
    turn = np.stack([along, np.cross(TOWARD, along), TOWARD], axis=1)
    w = np.sqrt(1 + np.trace(turn)) / 2
    return w, *((turn[k - 1, k - 2] - turn[k - 2, k - 1]) / (4 * w) for k in (0, 1, 2))


def spatial_picture(world, steps):
    sheet, projection = final_sheet(world, steps, LOWER, UPPER)
    colour_at = colours_of(sheet)
    return lambda place: colour_at(projection.plane(np.asarray(place, float))[0])


def test_what_is_turned_in_space_is_drawn_so():
    """A box, a capsule and a hull of 4 by 0.6, turned by 60 degrees about the way to the camera."""
    corners = [(x, y, z) for x in (-2, 2) for y in (-0.3, 0.3) for z in (-0.3, 0.3)]
    shapes = {-8: BoxCollider((2, 0.3, 0.3)), 0: CapsuleCollider(0.3, 1.7), 8: ConvexHullCollider(corners)}
    plugins = capsule.plugin, convex_hull.plugin
    with World(Physics(dimensions=3, gravity=(0.0, 0.0, 0.0)), Rotation(), *plugins) as world:
        for x, shape in shapes.items():
            upright = np.pi / 2 if isinstance(shape, CapsuleCollider) else 0.0
            turned = Transform(x * RIGHT, rotation=facing(np.pi / 3 - upright))
            world.create_entity(turned, RigidBody(kind="kinematic"), shape)
        colour_at = spatial_picture(world, 0)
    background = colour_at(-8 * UP)
    along = 0.5 * RIGHT + np.sqrt(0.75) * UP
    across = np.cross(TOWARD, along)
    for x in shapes:
        for way in (0 * along, 1.8 * along, -1.8 * along, 0.2 * across):
            assert np.abs(colour_at(x * RIGHT + way) - background).max() > 20
        for way in (2.4 * along, -2.4 * along, 0.6 * across, -0.6 * across, 1.8 * RIGHT):
            np.testing.assert_array_equal(colour_at(x * RIGHT + way), background)


@pytest.mark.parametrize("axes", [
    ((1, 0, 0), (0, 0, 1), (0, -1, 0)), ((1, 0, 0), (0, -1, 0), (0, 0, -1)), ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
])  # fmt: skip
def test_up_is_against_gravity(axes, tmp_path):
    """The picture of a turned world, under the same part of gravity, is that of the world."""
    pictures = []
    for turn in (np.eye(3), np.array(axes, float)):
        with World(Physics(dimensions=3, gravity=-9.81 * turn[1])) as world:
            world.create_entity(Transform((0, -0.5, 0) @ turn), AABBCollider(np.abs((5, 0.5, 4) @ turn)))
            for k in range(3):
                world.create_entity(Transform((k, 1 + k, -k) @ turn), RigidBody(), AABBCollider(0.5))
            (file,) = draw_run(run(world, 3), tmp_path / f"{len(pictures)}.png")
        pictures.append(np.array(Image.open(file), int))
    assert (np.abs(pictures[0] - pictures[1]) > 40).mean() < 1e-3 < (pictures[0] != pictures[0][0, 0]).mean()


def test_the_spots_of_a_ball_in_space_turn_with_it():
    """Near the rim there are those at both ends of its x axis, 0.6 rad in radius; a ball without a Spin has none."""
    with World(Physics(dimensions=3, gravity=(0.0, 0.0, 0.0)), Rotation()) as world:
        world.create_entity(Transform(-4 * RIGHT, rotation=facing(1.0)), RigidBody(), Spin(), SphereCollider(3))
        world.create_entity(Transform(4 * RIGHT), RigidBody(), SphereCollider(3))
        colour_at = spatial_picture(world, 0)
    plain = colour_at(4 * RIGHT - 2.0 * UP)
    edge = np.cos(0.6) / 0.9  # of the spots, as the cosine of the angle there
    for angle in np.linspace(0, 2 * np.pi, 60, endpoint=False):
        direction = np.cos(angle + 1.0) * RIGHT + np.sin(angle + 1.0) * UP
        np.testing.assert_array_equal(colour_at(4 * RIGHT + 2.7 * direction), plain)
        marked = np.abs(colour_at(-4 * RIGHT + 2.7 * direction) - plain).max() > 50
        if abs(abs(np.cos(angle)) - edge) > 0.03:
            assert marked == (abs(np.cos(angle)) > edge)


def test_ropes_and_parts_in_space_are_drawn_and_the_ground_ends_with_the_view():
    plugins = Joints(), Parts(), half_space.plugin
    with World(Physics(dimensions=3, gravity=(0.0, 0.0, 0.0)), Rotation(), *plugins) as world:
        world.create_entity(Transform((0, -4, 0)), HalfSpaceCollider((0, 1, 0)))
        ball = world.create_entity(Transform((2, 1, 3)), RigidBody(), SphereCollider(0.5))
        world.create_entity(Distance(None, ball, point_a=(0, 6, 0)))
        holder = world.create_entity(Transform(5 * UP, rotation=facing(np.pi / 3)), RigidBody(kind="kinematic"))
        world.create_entity(PartOf(holder, (4, 0, 0)), BoxCollider((0.4, 0.4, 0.4)))
        sheet, projection = final_sheet(world, 1, LOWER, UPPER)
    polygons, ropes = [], []
    for part in sheet.axes.collections:
        if isinstance(part, LineCollection):
            ropes += part.get_segments()
        elif isinstance(part, PolyCollection):
            polygons += [path.vertices for path in part.get_paths()]
    ends = projection.plane(np.array([(0, 6, 0), (2, 1, 3)]))[0]
    assert any(np.allclose(rope, ends) for rope in ropes)
    centre = projection.plane(5 * UP + 4 * (0.5 * RIGHT + np.sqrt(0.75) * UP))[0]
    assert any(np.linalg.norm(polygon.mean(axis=0) - centre) < 0.3 for polygon in polygons)
    seen = projection.plane(np.array([(x, -4, z) for x in (-12, 12) for z in (-12, 12)]))[0]
    assert any(np.allclose(np.ptp(polygon, axis=0), np.ptp(seen, axis=0)) for polygon in polygons)
    lower, upper = projection.frame()
    assert all((polygon > lower - 1e-9).all() and (polygon < upper + 1e-9).all() for polygon in polygons)
