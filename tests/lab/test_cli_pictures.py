"""Pictures of ``carom run``: final state, paths, and parts of them."""

from __future__ import annotations

import json
from pathlib import Path

import helpers_cli
import numpy as np
import pytest
from helpers_cli import refusal, report_of
from helpers_processes import run_python
from PIL import Image

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.lab.measure.run import FEW_BODIES, FEW_STEPS, run
from carom.plugins import Physics

carom, ball = helpers_cli.carom, helpers_cli.ball  # fixtures


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
    line = refusal(carom("run", "billiards", "--record", "film.mp4"))
    assert "--record takes a name that ends in .gif or .webp, not film.mp4" in line


@pytest.mark.parametrize("view", ["0,0,4", "0,0,4,x", "0,0,4,inf", "4,3,0,0", "0,0,4,0", "0,0,0,4,4", ""])
def test_a_view_that_is_none_is_refused(carom, view):
    assert "--view takes the lower and the upper corner" in refusal(carom("run", "jump", "--view", view))


def test_a_view_of_another_dimension_is_refused(carom):
    assert "view has 3 dimensions, the world 2" in refusal(carom("run", "jump", "--view", "0,0,0,4,4,4"))


def test_3d_is_drawn_too(carom, tmp_path, ball):
    text = ball.read_text().replace("dimensions=2", "dimensions=3").replace("-9.81)", "-9.81, 0.0)")
    text = (
        text.replace("(0, 0)", "(0, 0, 0)")
        .replace("(seed, 10)", "(seed, 10, 0)")
        .replace("(50, 0.5)", "(50, 0.5, 50)")
    )
    box = "    world.create_entity(Transform((3, 5, 1)), RigidBody(), AABBCollider(half_extents=(1, 0.5, 2)))"
    ball.write_text(text.replace("    return world", f"{box}\n    return world"))
    report = report_of(carom("run", "ball.py", "--steps", "30", "--record", "ball.webp", "--json"))
    assert report["dimensions"] == 3
    assert [Path(p).name for p in report["pictures"]] == ["ball-final.png", "ball-traces.png", "ball.webp"]
    assert all((tmp_path / p).is_file() for p in report["pictures"])


def test_without_matplotlib_the_run_goes_on_and_says_what_is_missing(tmp_path):
    code = "import sys; sys.modules['matplotlib'] = None; import carom.lab.cli.main as c; c.main()"
    result = run_python(code, "run", "jump", "--steps", "2", "--json", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "carom[plot]" in result.stderr
    assert json.loads(result.stdout)["pictures"] == []


def test_pictures_into_a_file_are_refused_before_the_run(carom, tmp_path):
    (tmp_path / "out").write_text("in the way")
    assert "--out" in refusal(carom("run", "jump"))


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
