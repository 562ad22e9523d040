"""``carom plugins``, ``carom plugins check``, ``carom plan`` and ``--plugin``, as plugin authors meet them."""

from __future__ import annotations

import importlib
import json
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

from carom.framework import Plugin
from carom.lab.cli import cli

pytestmark = pytest.mark.slow  # its shapes take long to compile

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OFFERED = PROJECT["entry-points"]["carom.plugins"]

BALL = """
from carom.components import SphereCollider
from carom.components.colliders import Collider
from carom.framework import Plugin, column
from carom.framework.vectors import add, divided, dot, length, negative, scale, sub
import math

plugin = Plugin("balls", version="1.2")

@plugin.shape(cost=1.2)
class BallCollider(Collider):
    radius = column(minimum=0.0)
    def bounds(shape, dimensions):
        if dimensions == 2:
            return shape.radius, shape.radius
        return shape.radius, shape.radius, shape.radius
    def support(shape, direction):
        return scale(direction, 0.0)
    def rounding(shape):
        return shape.radius

@plugin.kernel
def along(d, distance):
    return divided(d, distance) if distance > 0.0 else add(scale(d, 0.0), unit(d))

@plugin.kernel
def unit(d):
    return (1.0, 0.0) if len(d) == 2 else (1.0, 0.0, 0.0)

@plugin.pair(BallCollider, SphereCollider)
def ball_sphere(a, b, d):
    distance = length(d)
    depth = a.radius + b.radius - distance
    normal = along(d, distance)
    return depth >= 0.0, depth, normal, scale(normal, a.radius - 0.5 * depth)

@plugin.pair(BallCollider, BallCollider)
def ball_ball(a, b, d):
    distance = length(d)
    depth = a.radius + b.radius - distance
    normal = along(d, distance)
    return depth >= 0.0, depth, normal, scale(normal, a.radius - 0.5 * depth)
"""
SCENE = """
from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.plugins import Physics

def build(settings=None, seed=0):
    world = World(Physics(gravity=(0.0, -9.81)), settings=settings)
    world.create_entity(Transform((0, 10)), RigidBody(), SphereCollider(0.5))
    return world
"""


@pytest.fixture
def carom(tmp_path, monkeypatch):
    """Runs the command in an empty folder, on wide screens."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def run(*arguments: str):
        return CliRunner().invoke(cli, list(arguments))

    return run


def offer(folder: Path, name: str, points: dict[str, str], monkeypatch, version: str = "0.7") -> None:
    """Make it look as if a package were installed that offers these."""
    info = folder / f"{name}-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    lines = "".join(f"{point} = {value}\n" for point, value in points.items())
    (info / "entry_points.txt").write_text(f"[carom.plugins]\n{lines}")
    monkeypatch.syspath_prepend(str(folder))


def row_of(output: str, start: str) -> str:
    return next(line for line in output.splitlines() if line.startswith(start))


def refusal(result) -> str:
    assert result.exit_code == 2, (result.stdout, result.stderr, result.exception)
    assert result.stdout == ""
    return result.stderr.strip()


# -- what ships -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", OFFERED)
def test_what_ships_is_offered_and_can_be_loaded(name):
    module, _, attribute = OFFERED[name].partition(":")
    found = getattr(importlib.import_module(module), attribute)
    plugin = found if isinstance(found, Plugin) else found()
    assert isinstance(plugin, Plugin)
    assert plugin.adds()
    assert plugin.name.replace(" ", "_") == name
    assert f"](plugins/{name}.md)" in (ROOT / "docs" / "plugins.md").read_text(encoding="utf-8")
    assert (ROOT / "docs" / "plugins" / f"{name}.md").is_file()


# -- carom plugins --------------------------------------------------------------------------------


def test_the_list_names_version_package_and_what_each_adds(carom, tmp_path, monkeypatch):
    (tmp_path / "site" / "list_balls.py").parent.mkdir()
    (tmp_path / "site" / "list_balls.py").write_text(BALL)
    offer(tmp_path / "site", "ballpack", {"balls": "list_balls:plugin"}, monkeypatch)
    result = carom("plugins")
    assert result.exit_code == 0, result.stderr
    row = row_of(result.stdout, "balls")
    for part in ("1.2", "ballpack", "shapes BallCollider", "BallCollider and SphereCollider"):
        assert part in row


def test_broken_ones_are_shown_and_stop_nobody(carom, tmp_path, monkeypatch):
    site = tmp_path / "site"
    site.mkdir()
    (site / "good_balls.py").write_text(BALL)
    (site / "bad_balls.py").write_text("print('noise')\n1 / 0\n")
    (site / "no_balls.py").write_text("plugin = 3\n\ndef other():\n    return 4\n")
    points = {"a_bad": "bad_balls:plugin", "b_gone": "nowhere:plugin", "c_number": "no_balls:other"}
    offer(site, "badpack", points, monkeypatch)
    offer(site, "goodpack", {"z_good": "good_balls:plugin"}, monkeypatch)
    result = carom("plugins")
    assert result.exit_code == 0, result.stderr
    assert "broken: ZeroDivisionError: division by zero" in row_of(result.stdout, "a_bad")
    assert "broken: ModuleNotFoundError: No module named 'nowhere'" in row_of(result.stdout, "b_gone")
    assert "is no Plugin and makes none" in row_of(result.stdout, "c_number")
    assert "shapes BallCollider" in row_of(result.stdout, "z_good")
    assert "noise" not in result.stdout
    for name, reason in (("a_bad", "division by zero"), ("b_gone", "nowhere")):
        assert reason in refusal(carom("plugins", "check", name))
        assert reason in refusal(carom("run", "billiards", "--plugin", name))


def test_two_packages_with_one_name_are_told_apart(carom, tmp_path, monkeypatch):
    site = tmp_path / "site"
    site.mkdir()
    (site / "twice_balls.py").write_text(BALL)
    for package in ("onepack", "otherpack"):
        offer(site, package, {"balls": "twice_balls:plugin"}, monkeypatch)
    result = carom("plugins")
    assert result.stdout.count("several packages offer this name") == 2
    said = refusal(carom("plugins", "check", "balls"))
    assert "several installed packages offer a plugin named 'balls': " in said


def test_wrong_names_are_refused_with_a_hint(carom, tmp_path, monkeypatch):
    offer(tmp_path / "site", "ballpack", {"balls": "list_balls:plugin"}, monkeypatch)
    for command in (("run", "billiards"), ("plan", "billiards")):
        said = refusal(carom(*command, "--plugin", "bals"))
        assert said == "carom: no installed package offers a plugin named 'bals'; did you mean 'balls'?"
    assert "no plugin or module named 'bals'; did you mean 'balls'?" in refusal(carom("plugins", "check", "bals"))
    assert "no file 'balls.py'" in refusal(carom("plugins", "check", "balls.py"))
    assert "no command 'chekc'; did you mean 'check'?" in refusal(carom("plugins", "chekc"))


# -- carom plugins check --------------------------------------------------------------------------


@pytest.fixture
def check(carom, tmp_path):
    """Checks the good plugin with some of its text replaced; returns (exit code, what was printed)."""

    def run(*changes: tuple[str, str]) -> tuple[int, str]:
        text = BALL if not changes else BALL.replace("    radius = ", "    dimensions = (2,)\n    radius = ")
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "checked.py").write_text(text)
        result = carom("plugins", "check", "checked.py")
        assert result.exit_code in (0, 1), (result.stdout, result.stderr, result.exception)
        return result.exit_code, result.stdout

    return run


@pytest.mark.slow  # 2D and 3D, worlds and all; of the fast tests test_plugin_package.py checks a good one
def test_a_good_plugin_passes(check):
    code, said = check()
    assert code == 0, said
    assert said.splitlines()[-1] == "plugin balls: nothing found"
    for row in ("shape BallCollider", "pair BallCollider and SphereCollider", "pair BallCollider and BallCollider"):
        assert sum(line.startswith(row) and "12," in line for line in said.splitlines()) == 2


DEPTH = "    depth = a.radius + b.radius - distance\n"
SPHERE = "def ball_sphere(a, b, d):\n    distance = length(d)\n" + DEPTH
TWIN = "def ball_ball(a, b, d):\n    distance = length(d)\n" + DEPTH
RETURN = "    return depth >= 0.0, depth, normal, scale(normal, a.radius - 0.5 * depth)\n"
MISTAKES = {  # what passes at registration, and what the check says of it
    "depth of equal sizes only": (
        (SPHERE, SPHERE.replace("b.radius", "a.radius")),
        ("but their boxes do not", "make bounds enclose the whole shape"),
    ),
    "depth too large": (
        (SPHERE, SPHERE + "    if depth > 0.0:\n        depth = 2.0 * depth\n"),
        ("moved apart by that they are", "depth is how far the second shape has to move"),
    ),
    "depth too small": (
        (SPHERE, SPHERE + "    if depth > 0.0:\n        depth = 0.5 * depth\n"),
        ("moved apart by that they still overlap, by", "depth is how far the second shape has to move"),
    ),
    "apart where they touch": (
        (SPHERE, SPHERE.replace("+ b.radius", "+ min(b.radius, 2.0)")),
        ("along it, by their support functions, the depth is", "the depth, the normal, or the support function"),
    ),
    "never touching": (
        (SPHERE, SPHERE + "    depth = -1e-300\n"),
        ("they never touch", "to keep two shapes apart use layer and mask"),
    ),
    "distance too long": (
        (SPHERE, SPHERE + "    if depth < 0.0:\n        depth = 3.0 * depth\n"),
        ("the second shape moved by", "apart, depth is minus the distance"),
    ),
    "not the same from both sides": (
        (TWIN, TWIN.replace("a.radius + b.radius", "2.0 * a.radius")),
        ("and seen from the other shape", "a and b may change places"),
    ),
    "a root of what may be negative": (
        (SPHERE, SPHERE + "    depth += 0.0 * math.sqrt(2.0 * a.radius - b.radius)\n"),
        ("nan", "guard the divisions and roots that fail there"),
    ),
    "raises": (
        (SPHERE, SPHERE + "    if b.radius > 4.0 * a.radius + 1.0:\n        raise ValueError('too big')\n"),
        ("the compiled function raised ValueError: too big", "return a contact for every input"),
    ),
    "does not compile": (
        (SPHERE, SPHERE + "    depth = {'depth': depth}.get('depth')\n"),
        ("it does not compile", "use what numba compiles"),
    ),
    "point from the wrong centre": (
        (RETURN, "    return depth >= 0.0, depth, normal, add(d, scale(normal, 2.0 * a.radius + b.radius))\n"),
        ("the point of contact", "point counts from the centre of the first shape"),
    ),
    "bounds too small for large ones": (
        ("def bounds(shape, dimensions):\n", "def bounds(shape, dimensions):\n        if 2.0 < shape.radius < 9.0:\n"
         "            return 1.0, 1.0\n"),
        ("reach beyond the bounds", "make bounds enclose the whole shape"),
    ),
    "support for unit vectors only": (
        ("scale(direction, 0.0)", "scale(direction, 0.5 * shape.radius if 2.0 < shape.radius < 9.0 else 0.0)"),
        ("for a direction of another length", "the direction has any length"),
    ),
}  # fmt: skip


QUICK = ("depth too large", "not the same from both sides", "does not compile", "bounds too small for large ones")


@pytest.mark.parametrize(
    "mistake", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in MISTAKES]
)
def test_mistakes_that_pass_at_registration_are_found(check, mistake):
    change, expected = MISTAKES[mistake]
    code, said = check(change)
    assert code == 1, said
    for words in expected:
        assert words in said
    findings = [line for line in said.splitlines() if line.startswith("1. ")]
    assert len(findings) == 1
    assert "   for " in said
    assert "   cure: " in said
    assert said.splitlines()[-1].startswith("plugin balls: ")


def test_what_registration_refuses_is_one_line(carom, tmp_path):
    (tmp_path / "refused.py").write_text(BALL.replace("def ball_sphere(a, b, d)", "def ball_sphere(a, b)"))
    said = refusal(carom("plugins", "check", "refused.py"))
    assert "refused.py, line 30: plugin balls: pair ball_sphere of BallCollider and SphereCollider takes (a, b)" in said


def test_a_file_without_a_plugin_is_refused(carom, tmp_path):
    (tmp_path / "empty.py").write_text("x = 1\n")
    assert "empty.py defines no plugin" in refusal(carom("plugins", "check", "empty.py"))


SWEEP = """
@plugin.sweep(BallCollider, SphereCollider)
def ball_sphere_sweep(a, b, d, v):
    reach = a.radius + b.radius
    p, q, r = dot(v, v), dot(d, v), dot(d, d) - reach * reach
    if r <= 0.0:
        return True, 0.0
    root = q * q - p * r
    if root < 0.0 or q >= 0.0:
        return False, 1.0
    time = FACTOR * r / (-q + math.sqrt(root))
    return time <= 1.0, min(time, 1.0)
"""


SWEEPS = [("1.1", 1), *(pytest.param(*case, marks=pytest.mark.slow) for case in (("1.0", 0), ("0.9", 1)))]


@pytest.mark.parametrize(("factor", "code"), SWEEPS)
def test_sweeps_are_compared_with_the_depth(check, factor, code):
    after = "@plugin.pair(BallCollider, BallCollider)"
    found, said = check((after, SWEEP.replace("FACTOR", factor) + "\n" + after))
    assert found == code, said
    assert ("overlap by" in said or "do not touch" in said) is bool(code)


OTHERS = """
import numpy as np
from carom.framework import Plugin

plugin = Plugin("others")

@plugin.mixing_rule("mean")
def mean(x, y):
    return 0.5 * (x + y)

@plugin.mixing_rule("odd")
def odd(x, y):
    return x if x < 0.4 and y < 0.7 else max(x, y)

@plugin.broad_phase("all")
class All:
    def pairs(self, lower, upper, moving):
        i, j = np.triu_indices(len(lower), 1)
        keep = (i < moving) & (lower[i] <= upper[j]).all(axis=1) & (lower[j] <= upper[i]).all(axis=1)
        return i[keep], j[keep]

@plugin.broad_phase("nearly all")
class NearlyAll:
    def pairs(self, lower, upper, moving):
        first, second = All().pairs(lower, upper, moving)
        return first[:-1], second[:-1]
"""
FAILING = """
from carom.framework import Phase, Plugin, System

plugin = Plugin("failing")

@plugin.system
class Failing(System):
    phase = Phase.START
    def process(self, dt):
        raise RuntimeError("no idea")
"""


def test_other_things_are_checked_too(carom, tmp_path):
    (tmp_path / "others.py").write_text(OTHERS)
    result = carom("plugins", "check", "others.py")
    assert result.exit_code == 1
    assert "ok" in row_of(result.stdout, "mixing rule mean")
    assert "1 finding" in row_of(result.stdout, "mixing rule odd")
    assert "ok" in row_of(result.stdout, "broad phase all")
    assert "1 finding" in row_of(result.stdout, "broad phase nearly all")
    assert "it misses the pair of rows" in result.stdout
    assert "world" not in result.stdout  # what is wrong already need not fail once more


def test_a_system_that_fails_is_found_by_a_world_with_it(carom, tmp_path):
    (tmp_path / "failing.py").write_text(FAILING)
    result = carom("plugins", "check", "failing.py")
    assert result.exit_code == 1
    assert "a step failed: system Failing failed in step 0" in result.stdout
    assert "no idea" in result.stdout


@pytest.mark.slow  # for worlds in 2D and 3D
def test_several_plugins_of_a_file_and_shapes_of_other_plugins(carom, tmp_path):
    first = BALL[: BALL.index("@plugin.pair(BallCollider, BallCollider)")]
    (tmp_path / "balls_file.py").write_text(first.replace("    radius = ", "    dimensions = (2,)\n    radius = "))
    more = """
import math
from balls_file import BallCollider
from carom.components import AABBCollider
from carom.framework import Plugin

class Stranger(AABBCollider.__mro__[1]):
    @staticmethod
    def bounds(shape, dimensions):
        return 1.0, 1.0

one, two = Plugin("one"), Plugin("two")

@one.pair(BallCollider, BallCollider)
def ball_ball(a, b, d):
    distance = math.hypot(d[0], d[1])
    depth = a.radius + b.radius - distance
    n = (d[0] / distance, d[1] / distance) if distance > 0.0 else (1.0, 0.0)
    return depth >= 0.0, depth, n, ((a.radius - 0.5 * depth) * n[0], (a.radius - 0.5 * depth) * n[1])

@two.pair(BallCollider, Stranger)
def ball_stranger(a, b, d):
    return False, -1e-9, (1.0, 0.0), (0.0, 0.0)
"""
    (tmp_path / "more_balls.py").write_text(more)
    result = carom("plugins", "check", "more_balls.py")
    assert result.exit_code == 0, result.stdout
    assert "ok" in row_of(result.stdout, "pair BallCollider and BallCollider")
    assert "no plugin here has the shape Stranger" in row_of(result.stdout, "pair BallCollider and Stranger")
    assert "plugin one: nothing found" in result.stdout
    assert "plugin two: nothing found" in result.stdout


# -- carom plan, --plugin -------------------------------------------------------------------------


def test_plan_prints_what_a_step_runs(carom):
    result = carom("plan", "freefall", "--settings", "accurate", "--set", "integrator=rk4")
    assert result.exit_code == 0, result.stderr
    for words in ("FORCES", "ForceAccumulation", "rk4, order 4", "no colliders: nothing to do"):
        assert words in result.stdout


def test_plan_takes_a_file_and_blames_its_line(carom, tmp_path):
    (tmp_path / "scene.py").write_text(SCENE)
    assert "NarrowPhase" in carom("plan", "scene.py").stdout
    (tmp_path / "scene.py").write_text(SCENE.replace("    return world", "    return 1 / 0"))
    assert "scene.py, line 9: ZeroDivisionError" in refusal(carom("plan", "scene.py"))
    assert "no scene named 'freefal'; did you mean 'freefall'?" in refusal(carom("plan", "freefal"))


PUSH = """
from carom.framework import ForceSystem, Plugin

plugin = Plugin("push")

@plugin.system
class Push(ForceSystem):
    def add_forces(self, bodies, time):
        bodies.force[:, 0] += bodies.mass

@plugin.integrator("lazy")
class Lazy:
    order, evaluations, path = 1, 1, 1
    def advance(self, motion, dt):
        motion.position += dt * motion.linear_velocity
"""


def test_plugins_join_the_world_of_run_and_plan(carom, tmp_path, monkeypatch):
    site = tmp_path / "site"
    site.mkdir()
    (site / "cli_push.py").write_text(PUSH)
    offer(site, "pushpack", {"push": "cli_push:plugin"}, monkeypatch)
    (tmp_path / "scene.py").write_text(SCENE)
    assert "Push" not in carom("plan", "scene.py").stdout
    assert "force systems Push" in carom("plan", "scene.py", "--plugin", "push").stdout
    result = carom("run", "scene.py", "--plugin", "push", "--steps", "60", "--json", "--no-pictures")
    assert result.exit_code == 0, result.stderr
    alone = carom("run", "scene.py", "--steps", "60", "--json", "--no-pictures")
    assert json.loads(result.stdout)["state_hash"] != json.loads(alone.stdout)["state_hash"]
    said = refusal(carom("plan", "scene.py", "--plugin", "push", "--plugin", "push"))
    assert said == "carom: --plugin push: a plugin named 'push' is in this world already"


def test_settings_can_name_what_a_plugin_brings(carom, tmp_path, monkeypatch):
    site = tmp_path / "site"
    site.mkdir()
    (site / "cli_lazy.py").write_text(PUSH)
    offer(site, "lazypack", {"push": "cli_lazy:plugin"}, monkeypatch)
    result = carom("plan", "freefall", "--set", "integrator=lazy", "--set", "dt=1/30", "--plugin", "push")
    assert result.exit_code == 0, result.stderr
    assert "lazy, order 1" in result.stdout
    assert "lazy" in refusal(carom("plan", "freefall", "--set", "integrator=lazy"))


# -- what ships, checked as everybody's is --------------------------------------------------------


def test_the_built_in_shapes_pass_the_check(carom):
    result = carom("plugins", "check", "carom.plugins.standard_shapes")
    assert result.exit_code == 0, result.stdout
    assert sum(" ok" in line for line in result.stdout.splitlines()) >= 10


@pytest.mark.parametrize("name", OFFERED)
def test_what_ships_passes_the_check(carom, name):
    result = carom("plugins", "check", OFFERED[name].partition(":")[0])
    assert result.exit_code == 0, result.stdout
