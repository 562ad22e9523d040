"""The ``carom`` command as its users meet it: what it prints, what it draws, and how it says no."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from carom import __version__, scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.lab.choices import parse_assignments
from carom.lab.cli import cli
from carom.lab.run import FEW_BODIES, FEW_STEPS, Traces, run
from carom.plugins import Physics

FALLING_BALL = """
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics

def build(settings=None, seed=0):
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), settings=settings or Settings.balanced())
    world.create_entity(Transform((0, 0)), AABBCollider(half_extents=(50, 0.5)))
    world.create_entity(Transform((seed, 10)), RigidBody(mass=2.0), SphereCollider(radius=0.5))
    return world
"""


@pytest.fixture
def carom(tmp_path, monkeypatch):
    """Runs the command in an empty folder; the result has exit_code, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str):
        return CliRunner().invoke(cli, list(arguments))

    return run


def test_traces_keep_those_that_went_farthest():
    """Three bodies on a line: 3 goes 2 to and fro, 7 goes 1, 8 goes 5 and is deleted."""
    along = np.array([[0, 0, 0], [1, 0, 5], [0, 1, np.nan]], np.float32)
    samples = [np.stack([row, np.zeros(3, np.float32)], axis=1) for row in along]
    kept = Traces(np.array([3, 7, 8]), samples).farthest(2)
    assert kept.entities.tolist() == [3, 8]
    np.testing.assert_array_equal(kept.positions[:, :, 0], along[:, [0, 2]])


@pytest.fixture
def ball(tmp_path) -> Path:
    path = tmp_path / "ball.py"
    path.write_text(FALLING_BALL)
    return path


def report_of(result) -> dict:
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


def refusal(result) -> str:
    """The one line of a refusal: exit code 2, nothing on stdout, no traceback."""
    assert result.exit_code == 2, (result.exit_code, result.stdout, result.stderr, result.exception)
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("carom: ")
    return lines[0]


def test_run_prints_the_tables_and_draws_two_pictures(carom, tmp_path):
    result = carom("run", "billiards", "--seconds", "0.3", "--out", "pictures")
    assert result.exit_code == 0, result.stderr
    expected = (
        "billiards",
        "16 dynamic",
        "contacts",
        "energy drift",
        "momentum drift",
        "deepest overlap",
        "escaped",
    )
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
    report = report_of(carom("run", "ball.py", "--steps", "30", "--json"))
    assert report["dimensions"] == 3
    assert [Path(p).name for p in report["pictures"]] == ["ball-final.png", "ball-traces.png"]
    assert all((tmp_path / p).is_file() for p in report["pictures"])


def test_json_is_the_only_output_and_holds_what_the_table_shows(carom):
    report = report_of(carom("run", "gas2d", "--steps", "20", "--json", "--no-pictures", "--seed", "4"))
    assert report["scene"] == "gas2d"
    assert report["seed"] == 4
    assert report["steps"] == 20
    assert report["simulated_seconds"] == pytest.approx(20 / 60)
    assert report["bodies"] == {"total": 1004, "dynamic": 1000, "kinematic": 0, "static": 4}
    assert report["contacts"]["impacts"] > 0
    assert report["step_milliseconds"] > 0
    assert sum(report["system_milliseconds"].values()) > 0
    assert abs(report["energy"]["relative"]) < 1e-11
    assert report["escaped"] == {"outside": 0, "non_finite": 0}
    assert report["deepest_overlap"] < 1.0
    assert report["pictures"] == []


def test_energy_drift_is_measured_against_the_largest_kinetic_energy(carom, ball):
    """Explicit Euler gains m g (g dt t / 2) in free fall, by position; the scale is m (g t)^2 / 2."""
    explicit = ("--set", "integrator=explicit_euler")
    report = report_of(carom("run", "ball.py", "--steps", "30", *explicit, "--json", "--no-pictures"))
    assert report["energy"]["relative"] == pytest.approx((1 / 60) / 0.5, rel=1e-9)


def test_bodies_beyond_the_walls_and_broken_ones_count_as_escaped(carom, ball):
    ball.write_text(
        ball.read_text().replace(
            "    return world",
            "    bullet = RigidBody(linear_velocity=(0, -1e4))\n"
            "    world.create_entity(Transform((9, 10)), bullet, SphereCollider(radius=0.5))\n"
            "    return world",
        )
    )
    report = report_of(carom("run", "ball.py", "--steps", "10", "--json", "--no-pictures"))
    assert report["escaped"] == {"outside": 1, "non_finite": 0}  # through the floor; the upper side is open


def test_bodies_that_are_not_finite_are_counted_and_the_rest_is_still_drawn(carom, ball):
    """1e200 m/s: the kinetic energy overflows at once, the position after some steps of 1e150 s."""
    fast = "    world.create_entity(Transform((5, 5)), RigidBody(linear_velocity=(1e200, 0)))"
    ball.write_text(ball.read_text().replace("    return world", f"{fast}\n    return world"))
    result = carom("run", "ball.py", "--steps", "3", "--set", "dt=1e150", "--json")
    report = report_of(result)
    assert "NaN" not in result.stdout
    assert "Infinity" not in result.stdout
    assert report["energy"]["start"] is None
    assert report["escaped"]["non_finite"] >= 1


def test_to_jump_over_an_obstacle_is_no_escape(carom):
    report = report_of(carom("run", "jump", "--json", "--no-pictures"))
    assert report["escaped"] == {"outside": 0, "non_finite": 0}


def test_the_worlds_faults_are_shown(carom, ball):
    """A body between two elastic walls that leave it no room bounces more often than a step allows."""
    text = ball.read_text().replace(
        "SphereCollider(radius=0.5)", "SphereCollider(radius=0.5, restitution=1.0)"
    )
    text = text.replace("gravity=(0.0, -9.81)", "gravity=(0.0, 0.0)").replace("(seed, 10)", "(0, 1.001)")
    text = text.replace("mass=2.0", "linear_velocity=(0, 20)")
    wall = "    world.create_entity(Transform((0, 2.01)), AABBCollider(half_extents=(50, 0.5)))"
    ball.write_text(text.replace("    return world", f"{wall}\n    return world"))
    result = carom("run", "ball.py", "--steps", "3", "--no-pictures")
    assert result.exit_code == 0, result.stderr
    assert "! step 0: " in result.stdout or "! step 1: " in result.stdout


def test_settings_come_from_the_scene_then_the_preset_then_set(carom):
    def settings(*arguments):
        return report_of(carom("run", "billiards", "--steps", "1", "--json", "--no-pictures", *arguments))[
            "settings"
        ]

    assert settings()["dt"] == pytest.approx(1 / 960)
    assert settings("--settings", "accurate")["substeps"] == Settings.accurate().substeps
    changed = settings("--set", "substeps=7", "--set", "restitution_threshold=0.25")
    assert (changed["dt"], changed["substeps"], changed["restitution_threshold"]) == (1 / 960, 7, 0.25)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("dt=1/120", 1 / 120),
        ("dt=0.01", 0.01),
        ("substeps=8", 8),
        ("slop=none", None),
        ("slop=1e-3", 1e-3),
        ("debug=yes", True),
        ("restitution_mixing=min", "min"),
        ("integrator = rk4", "rk4"),
    ],
)
def test_set_takes_the_types_of_the_fields(text, value):
    assert list(parse_assignments([text]).values()) == [value]


def test_seconds_and_steps(carom, ball):
    def steps(*arguments):
        return report_of(carom("run", "ball.py", "--json", "--no-pictures", *arguments))["steps"]

    assert steps("--seconds", "0.5") == 30
    assert steps("--seconds", "0.5", "--set", "dt=1/120") == 60
    assert steps("--steps", "0") == 0


def test_the_seed_reaches_the_scene_and_equal_seeds_give_equal_bits(carom):
    def state(seed):
        return report_of(
            carom("run", "asteroids", "--steps", "5", "--json", "--no-pictures", "--seed", seed)
        )["state_hash"]

    assert state("1") == state("1") != state("2")


def test_a_file_imports_its_neighbours_and_tells_how_long_it_runs(carom, tmp_path, ball):
    (tmp_path / "components.py").write_text("SPEED = 3.0\n")  # a name that carom has a package of, too
    text = ball.read_text().replace("def build", "from components import SPEED\nSECONDS = 0.2\n\ndef build")
    ball.write_text(text.replace("RigidBody(mass=2.0)", "RigidBody(linear_velocity=(SPEED, 0))"))
    report = report_of(carom("run", "ball.py", "--json", "--no-pictures"))
    assert report["steps"] == 12
    assert report["momentum"]["start"] == [3.0, 0.0]
    assert not (tmp_path / "__pycache__" / "ball.cpython-311.pyc").exists()


def test_scenes_lists_all_with_their_descriptions(carom):
    result = carom("scenes")
    assert result.exit_code == 0
    for name in scenes.names():
        assert name in result.stdout


def test_alone_it_shows_what_it_can_do(carom):
    result = carom()
    assert result.exit_code == 0
    assert "Commands:" in result.stdout


def test_version_and_python_dash_m():
    result = subprocess.run(
        [sys.executable, "-m", "carom", "--version"], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == f"carom, version {__version__}"


def test_without_matplotlib_the_run_goes_on_and_says_what_is_missing(tmp_path):
    code = "import sys; sys.modules['matplotlib'] = None; import carom.lab.cli as c; c.main()"
    command = [sys.executable, "-c", code, "run", "jump", "--steps", "2", "--json"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert "carom[plot]" in result.stderr
    assert json.loads(result.stdout)["pictures"] == []


def test_the_progress_says_what_compiles(tmp_path, monkeypatch):
    """With an empty cache of its own: the names of kernels appear while they compile."""
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich then animates into the pipe
    command = [sys.executable, "-m", "carom", "run", "jump", "--no-pictures", "--steps", "60"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert "compiling" in result.stderr
    assert "60/60" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "asteroid"], ["no scene named 'asteroid'", "did you mean 'asteroids'?"]),
        (["run", "xyz"], ["no scene named 'xyz'", "gas2d"]),
        (["run", "folder/thing"], ["no file 'folder/thing'"]),
        (["run"], ["Missing argument"]),
        (["rum", "jump"], ["no command 'rum'", "did you mean 'run'?"]),
        (["run", "jump", "--step", "3"], ["--step", "--steps"]),
        (["run", "jump", "--steps", "-1"], ["--steps", "-1"]),
        (["run", "jump", "--steps", "many"], ["--steps", "many"]),
        (["run", "jump", "--seconds", "-1"], ["--seconds", "-1"]),
        (["run", "jump", "--seconds", "nan"], ["--seconds", "nan"]),
        (["run", "jump", "--steps", "3", "--seconds", "1"], ["--steps and --seconds"]),
        (["run", "jump", "--seed", "-4"], ["--seed"]),
        (["run", "jump", "--settings", "acurate"], ["'acurate'", "did you mean 'accurate'?"]),
        (["run", "jump", "--set", "substep=3"], ["no field 'substep'", "did you mean 'substeps'?"]),
        (["run", "jump", "--set", "substeps=three"], ["substeps takes a whole number, not 'three'"]),
        (["run", "jump", "--set", "substeps=2.5"], ["substeps takes a whole number, not '2.5'"]),
        (["run", "jump", "--set", "dt=fast"], ["dt takes a number, not 'fast'"]),
        (["run", "jump", "--set", "dt=1/0"], ["dt takes a number, not '1/0'"]),
        (["run", "jump", "--set", "dt=-1"], ["dt", "-1"]),
        (["run", "jump", "--set", "dt=nan"], ["dt", "nan"]),
        (["run", "jump", "--set", "substeps"], ["field=value"]),
        (["run", "jump", "--set", "debug=perhaps"], ["debug takes true or false"]),
        (["run", "jump", "--set", "dt=1", "--set", "dt=2"], ["dt twice"]),
        (["run", "jump", "--set", "restitution_mixing=maxx"], ["'maxx'", "did you mean 'max'"]),
        (["run", "jump", "--set", "collision=discreet"], ["'discreet'", "discrete"]),
        (["run", "jump", "--set", "integrator=verlet"], ["verlet", "velocity_verlet"]),
    ],
    ids=lambda value: " ".join(value[1:]) if value and value[0] in {"run", "rum"} else "",
)
def test_wrong_names_and_values(carom, arguments, words):
    line = refusal(carom(*arguments))
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def build(settings=None, seed=0)\n    pass\n", ["scene.py, line 1"]),
        (
            "x = 1\n\nraise RuntimeError('no luck')\ndef build(settings, seed=0): ...\n",
            ["scene.py, line 3", "RuntimeError", "no luck"],
        ),
        ("import numppy\ndef build(settings, seed=0): ...\n", ["scene.py, line 1", "numppy"]),
        ("import sys\nsys.exit(3)\ndef build(settings, seed=0): ...\n", ["scene.py, line 2", "SystemExit"]),
        ("def biuld(settings=None, seed=0): ...\n", ["defines no build(settings, seed=0)", "'biuld'"]),
        ("build = 3\n", ["defines no build(settings, seed=0)"]),
        ("\ndef build(world): ...\n", ["line 2", "build must take (settings, seed=0)"]),
        ("def build(settings=None, seed=0): pass\n", ["build returned nothing (None), not a World"]),
        ("def build(settings=None, seed=0):\n    return [1]\n", ["build returned a list, not a World"]),
        (
            "def build(settings=None, seed=0):\n    return 1 / seed\n",
            ["scene.py, line 2", "ZeroDivisionError"],
        ),
        (
            "from carom.framework import World\ndef build(settings=None, seed=0):\n    return World()\n",
            ["no physics in this world"],
        ),
    ],
)
def test_wrong_files(carom, tmp_path, text, words):
    (tmp_path / "scene.py").write_text(text)
    line = refusal(carom("run", "scene.py", "--no-pictures"))
    for word in words:
        assert word in line


def test_a_wrong_value_inside_build_names_its_line(carom, ball):
    ball.write_text(ball.read_text().replace("mass=2.0", "mass=-2.0"))
    line = refusal(carom("run", "ball.py", "--no-pictures"))
    assert "ball.py, line 9" in line
    assert "mass" in line


def test_an_error_in_the_middle_of_a_run_names_its_line(carom, ball):
    ball.write_text(
        ball.read_text().replace(
            "    return world",
            "    from carom.framework import Phase, System\n"
            "    class Bomb(System):\n"
            "        phase = Phase.END\n"
            "        def process(self, dt):\n"
            "            if self.world.step_count >= 3:\n"
            "                raise RuntimeError('boom')\n"
            "    world.add_system(Bomb())\n"
            "    return world",
        )
    )
    result = carom("run", "ball.py", "--no-pictures")
    assert result.exit_code == 2
    line = result.stderr.splitlines()[-1]
    assert line.startswith("carom: ball.py, line 15")
    assert "boom" in line
    assert "Traceback" not in result.stderr


def test_missing_file_suggests_its_neighbour(carom, ball):
    assert "did you mean 'ball.py'?" in refusal(carom("run", "bal.py"))


def test_traceback_on_request(carom, tmp_path):
    (tmp_path / "scene.py").write_text("raise RuntimeError('no luck')\ndef build(settings, seed=0): ...\n")
    result = carom("run", "scene.py", "--traceback")
    assert result.exit_code != 0
    assert result.exception is not None
    assert "no luck" in str(result.exception)


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


def test_a_file_gets_settings_to_change(carom, ball):
    text = ball.read_text().replace("settings=settings or Settings.balanced()", "settings=settings.replace(dt=1 / 30)")
    ball.write_text(text)
    report = report_of(carom("run", "ball.py", "--steps", "1", "--json", "--no-pictures"))
    assert report["settings"]["dt"] == 1 / 30


def test_a_file_without_build_is_not_executed(carom, tmp_path):
    (tmp_path / "game.py").write_text("open('played', 'w').close()\nwhile True: pass\n")
    assert "defines no build" in refusal(carom("run", "game.py"))
    assert not (tmp_path / "played").exists()


def test_what_a_file_prints_stays_out_of_the_json(carom, ball):
    text = "print('at import')\n" + ball.read_text()
    system = (
        "    print('in build')\n"
        "    from carom.framework import Phase, System\n"
        "    class Loud(System):\n"
        "        phase = Phase.END\n"
        "        def process(self, dt):\n"
        "            print('in a step')\n"
        "    world.add_system(Loud())\n"
    )
    ball.write_text(text.replace("    return world", system + "    return world"))
    result = carom("run", "ball.py", "--steps", "2", "--json", "--no-pictures")
    assert report_of(result)["steps"] == 2
    for words in ("at import", "in build", "in a step"):
        assert words in result.stderr


def test_energy_that_overflows_is_said_to(carom, ball):
    fast = "    world.create_entity(Transform((5, 5)), RigidBody(linear_velocity=(1e200, 0)))"
    ball.write_text(ball.read_text().replace("    return world", f"{fast}\n    return world"))
    result = carom("run", "ball.py", "--steps", "3", "--no-pictures")
    assert "not representable" in result.stdout
    assert "nan" not in result.stdout


def test_energy_that_is_not_conserved_says_why(carom):
    assert "restitution below 1" in carom("run", "jump", "--no-pictures").stdout
    report = report_of(carom("run", "gas2d", "--steps", "9", "--json", "--no-pictures"))
    assert report["energy_changes"] == []
    report = report_of(carom("run", "billiards", "--steps", "300", "--json", "--no-pictures"))
    assert report["energy_changes"] == ["restitution below 1", "damping"]


def test_sensors_do_not_overlap(carom, ball):
    sensor = "    world.create_entity(Transform((0, 9)), AABBCollider(half_extents=(3, 3), sensor=True))"
    ball.write_text(ball.read_text().replace("    return world", f"{sensor}\n    return world"))
    report = report_of(carom("run", "ball.py", "--steps", "9", "--json"))
    assert report["contacts"]["end"] == 1
    assert report["deepest_overlap"] == 0


def test_a_file_says_its_view_and_its_seconds(carom, ball):
    text = ball.read_text()
    ball.write_text(f"{text}\nseconds = 0.25\nview = ((-5, -1), (5, 12))\n")
    assert report_of(carom("run", "ball.py", "--json"))["steps"] == 15
    ball.write_text(f"{text}\nview = ((-5, -1, 0), (5, 12, 1))\n")
    assert "3 dimensions" in refusal(carom("run", "ball.py"))
    ball.write_text(f"{text}\nview = 7\n")
    assert "view must be" in refusal(carom("run", "ball.py"))


def test_bodies_created_on_the_way_and_kinematic_ones_are_traced():
    world = World(Physics(dimensions=2, gravity=(0.0, 0.0)))
    lift = world.create_entity(Transform((0, 0)), RigidBody(kind="kinematic", linear_velocity=(0, 1)))
    world.create_entity(Transform((9, 0)), RigidBody())  # stays where it is
    created = []

    def create(step: int) -> None:
        if step == 5:
            created.append(world.create_entity(Transform((3, 3)), RigidBody(linear_velocity=(5, 0))))

    traces = run(world, 10, after_step=create).traces
    assert traces.entities.tolist() == sorted([lift, *created])
    assert traces.moved == 2
    world.close()


def test_a_short_run_keeps_the_corners_of_its_paths():
    """A ball to and fro between two walls, a box against a wall: where the ball turned, and the paths through it."""
    settings = Settings(collision="continuous")
    with World(Physics(dimensions=2, gravity=(0.0, 0.0)), settings=settings) as world:
        for x in (-1.75, 1.75):
            world.create_entity(Transform((x, 0)), AABBCollider((0.5, 5), restitution=1.0))
        ball = world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(120, 0)), SphereCollider(0.25))
        box = world.create_entity(Transform((0, 3)), RigidBody(linear_velocity=(75, 0)), AABBCollider((0.25, 0.25)))
        traces = run(world, 2).traces
    world.close()
    blows = traces.blows or []
    # The ball, which goes 2 in a step, turns 1 to the right, then 1 to the left; the box to the right, a little later.
    assert [(blow.after, len(blow.centres)) for blow in blows] == [(1, 1), (1, 0), (2, 1)]
    struck = [(blow.centres[ball][0], blow.after) for blow in blows if ball in blow.centres]
    np.testing.assert_allclose(struck, [(1, 1), (-1, 2)], rtol=0, atol=1e-12)
    assert not any(box in blow.centres for blow in blows)
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
    assert traces.blows is None
    np.testing.assert_array_equal(traces.corners, traces.positions)


def test_the_rows_of_the_step_add_up(carom):
    report = report_of(carom("run", "gas2d", "--steps", "30", "--json", "--no-pictures"))
    assert 0 < sum(report["system_milliseconds"].values()) <= report["step_milliseconds_mean"]
    assert "everything else" in carom("run", "jump", "--steps", "30", "--no-pictures").stdout


def test_other_targets_and_seeds_are_refused_clearly(carom, tmp_path):
    (tmp_path / "notes.txt").write_text("def build")
    assert "not a Python file" in refusal(carom("run", "notes.txt"))
    assert "is a folder" in refusal(carom("run", "."))
    assert "--seed takes a whole number of at least 0, not 'x'" in refusal(carom("run", "jump", "--seed", "x"))
