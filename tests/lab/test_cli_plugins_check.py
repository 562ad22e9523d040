"""``carom plugins check`` for plugin authors: plugins that pass, and findings."""

from __future__ import annotations

import helpers_cli_plugins
import numpy as np
import pytest
from helpers_cli_plugins import BALL, OFFERED, refusal, row_of

from carom.lab.plugins.samples import all_examples

pytestmark = pytest.mark.slow  # its shapes take long to compile

carom = helpers_cli_plugins.carom  # a fixture


# -- carom plugins check --------------------------------------------------------------------------


@pytest.fixture
def check(carom, tmp_path):
    """Check the good plugin with some of its text replaced; returns (exit code, output)."""

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


def test_a_good_plugin_passes(check):
    code, said = check()
    assert code == 0, said
    assert said.splitlines()[-1] == "plugin balls: nothing found"
    for row in ("shape BallCollider", "pair BallCollider and SphereCollider", "pair BallCollider and BallCollider"):
        assert sum(line.startswith(row) and " ok" in line for line in said.splitlines()) == 2
    assert "  4,800  ok" in said


DEPTH = "    depth = a.radius + b.radius - distance\n"
SPHERE = "def ball_sphere(a, b, d):\n    distance = length(d)\n" + DEPTH
TWIN = "def ball_ball(a, b, d):\n    distance = length(d)\n" + DEPTH
OVERFLOW = """    one = int(1.0 + 0.0 * distance)
    if (one << 62) * 4 == 0:
        return depth >= 0.0, depth, along(d, distance), scale(along(d, distance), a.radius - 0.4 * depth)
"""
NO_SUPPORT = BALL[BALL.index("    def support") : BALL.index("@plugin.kernel")], "\n"
SWEEP = """@plugin.sweep(BallCollider, SphereCollider)
def ball_sphere_sweep(a, b, d, v):
    hit, time = ball(d, v, a.radius + b.radius)
    return hit, time if a.radius < 2.0 else 0.9 * time

"""
SHALLOW = """    if depth > 0.0:
        middle = 0.5 * (max(-a.radius, distance - b.radius) + min(a.radius, distance + b.radius))
        return True, 0.3 * depth, along(d, distance), scale(along(d, distance), middle)
"""
TWINS = "@plugin.pair(BallCollider, BallCollider)"
MISTAKES = {  # that four poses of samples do not show: what is said of them, and the simplest input
    "depth of equal sizes only": (
        (SPHERE, SPHERE.replace("b.radius", "a.radius")),
        ("but their boxes do not", "make bounds enclose the whole shape", "a = BallCollider(radius=0.5)"),
    ),
    "apart where they touch": (
        (SPHERE, SPHERE.replace("+ b.radius", "+ min(b.radius, 2.0)")),
        ("along it, by their support functions, the depth is", "a = BallCollider(radius=500000000.0)"),
    ),
    "not the same from both sides": (
        (TWIN, TWIN.replace("a.radius + b.radius", "2.0 * a.radius")),
        ("and seen from the other shape", "a and b may change places", "d = (0.0, 0.0)"),
    ),
    "a root of what may be negative": (
        (SPHERE, SPHERE + "    depth += 0.0 * math.sqrt(2.0 * a.radius - b.radius)\n"),
        ("nan", "guard the divisions and roots that fail there", "d = (0.0, 0.0)"),
    ),
    "raises": (
        (SPHERE, SPHERE + "    if b.radius > 4.0 * a.radius + 1.0:\n        raise ValueError('too big')\n"),
        ("the compiled function raised ValueError: too big", "return a result for every input", "d = (0.0, 0.0)"),
    ),
    "does not compile": (
        (SPHERE, SPHERE + "    depth = max([depth], key=abs)\n"),
        ("it does not compile", "use what numba compiles", "checked.py, line 36"),
    ),
    "bounds too small for large ones": (
        ("def bounds(shape, dimensions):\n", "def bounds(shape, dimensions):\n        if 2.0 < shape.radius < 9.0:\n"
         "            return 1.0, 1.0\n"),
        ("reach beyond the bounds (1.0, 1.0)", "make bounds enclose the whole shape", "radius=2.0"),
    ),
    "outline of large ones": (
        ("    def support", "    def outline(shape, dimensions):\n"
         "        return [(0.0, shape.radius if 2.0 < shape.radius < 9.0 else 0.0)], ()\n    def support"),
        ("the outline reaches", "draw the shape that bounds and support describe", "radius=2.0"),
    ),
    "another result in Python": (
        (SPHERE, SPHERE + OVERFLOW),
        ("compiled it returns", "as plain Python", "no global that changes"),
    ),
    "depth too small, without a support": (
        (SPHERE, SPHERE + SHALLOW),
        ("moved apart by that they still overlap, by", "normal points from the first shape to the second"),
    ),
    "never touching": (
        (SPHERE, SPHERE + "    depth = min(depth, -1e-300)\n"),
        ("they never touch", "to keep two shapes apart use layer and mask", "d = (0.0, 0.0)"),
    ),
    "point on one side": (
        (TWIN, TWIN + "    if depth > 0.0:\n        n = along(d, distance)\n"
         "        return True, depth, n, scale(n, a.radius + 0.9 * depth)\n"),
        ("the points of contact seen from both sides are", "in the middle of the overlap"),
    ),
    "sweep of large ones": (
        (TWINS, SWEEP + TWINS), ("at the sweep's time", "they do not touch", "part of v after which"),
    ),
}  # fmt: skip


WITHOUT_SUPPORT = ("depth too small, without a support", "never touching")
OFTEN = "apart where they touch", "raises", "does not compile", "never touching", "sweep of large ones"
FIND_SIMPLEST = "carom.lab.plugins.check.simplest"  # takes most of the time, and does the same for all laws


@pytest.mark.parametrize("mistake", [pytest.param(k, marks=() if k in OFTEN else pytest.mark.long) for k in MISTAKES])
def test_mistakes_that_pass_at_registration_are_found(check, mistake, monkeypatch):
    change, expected = MISTAKES[mistake]
    if mistake == "sweep of large ones":
        monkeypatch.setattr(FIND_SIMPLEST, lambda is_wanted: None)
    code, said = check(change, *([NO_SUPPORT] if mistake in WITHOUT_SUPPORT else []))
    assert code == 1, said
    for words in expected:
        assert words in said
    assert len([line for line in said.splitlines() if line.startswith("1. ")]) == 1
    assert "   for " in said
    assert "   cure: " in said
    assert said.splitlines()[-1].startswith("plugin balls: ")


def test_the_same_examples_are_drawn_again(monkeypatch, tmp_path):
    """Where none are kept, and where the file is broken."""
    expected = all_examples()
    monkeypatch.setattr("carom.lab.plugins.samples._folder", lambda: tmp_path / "other")
    for _ in range(2):
        all_examples.cache_clear()
        np.testing.assert_array_equal(all_examples(), expected)
        next((tmp_path / "other").glob("*.npy")).write_bytes(b"half of it")
    assert np.unique(expected, axis=0).shape == expected.shape
    assert np.abs(expected).max() < 1.0


def test_without_hypothesis_it_is_named(check, carom, monkeypatch, tmp_path):
    (tmp_path / "good.py").write_text(BALL)
    all_examples.cache_clear()
    monkeypatch.setattr("importlib.metadata.version", missing)
    assert refusal(carom("plugins", "check", "good.py")).endswith("pip install 'carom[check]'")


def missing(name):
    raise ImportError(name)


def test_what_registration_refuses_is_one_line(carom, tmp_path):
    (tmp_path / "refused.py").write_text(BALL.replace("def ball_sphere(a, b, d)", "def ball_sphere(a, b)"))
    said = refusal(carom("plugins", "check", "refused.py"))
    assert "refused.py, line 31: plugin balls: pair ball_sphere of BallCollider and SphereCollider takes (a, b)" in said


def test_a_file_without_a_plugin_is_refused(carom, tmp_path):
    (tmp_path / "empty.py").write_text("x = 1\n")
    assert "empty.py defines no plugin" in refusal(carom("plugins", "check", "empty.py"))


OTHERS = """
import numpy as np
from carom.framework import Plugin

plugin = Plugin("others")

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
    assert "ok" in row_of(result.stdout, "broad phase all")
    assert "1 finding" in row_of(result.stdout, "broad phase nearly all")
    assert " 0 times" in result.stdout
    assert "world" not in result.stdout  # a known defect is not reported again by a world


def test_a_system_that_fails_is_found_by_a_world_with_it(carom, tmp_path):
    (tmp_path / "failing.py").write_text(FAILING)
    result = carom("plugins", "check", "failing.py")
    assert result.exit_code == 1
    assert "a step failed: system Failing failed in step 0" in result.stdout
    assert "no idea" in result.stdout


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


# -- shipped plugins, checked like any other ------------------------------------------------------


def test_the_built_in_shapes_pass_the_check(carom):
    result = carom("plugins", "check", "carom.plugins.standard_shapes")
    assert result.exit_code == 0, result.stdout
    assert sum(" ok" in line for line in result.stdout.splitlines()) >= 10


# Pieces of terrain leave to their neighbours what a shape of their own would have: docs/plugins/terrain.md.
@pytest.mark.parametrize("name", sorted({*OFFERED} - {"terrain"}))
def test_what_ships_passes_the_check(carom, name):
    result = carom("plugins", "check", OFFERED[name].partition(":")[0])
    assert result.exit_code == 0, result.stdout


ROPE = """
from carom import Plugin, column
from carom.framework.vectors import add, divided, length, scale, sub
from carom.plugins.joints import Joint, arm_of, moment

plugin = Plugin("ropes")

@plugin.joint
class Rope(Joint):
    dimensions = (2,)
    a = column(dtype=int)
    b = column(dtype=int)
    hook = column(item="vector")
    at = column(0.3, item="vector", kw_only=True)

    def constraint(joint, a, b):
        arm = arm_of(b, joint.at)
        way = sub(add(b.position, arm), joint.hook)
        along, nothing = divided(way, length(way)), scale(way, 0.0)
        return length(way), nothing, nothing, along, moment(arm, scale(along, FACTOR))
"""


@pytest.mark.parametrize(
    ("factor", "code"),
    [pytest.param("1.0", 0, marks=pytest.mark.long), ("(1.0 if length(way) < 2.0 else 2.0)", 1), ("2.0", 2)],
    ids=["right", "far", "2"],
)
def test_joints_are_compared_with_the_change_of_their_value(carom, tmp_path, factor, code, monkeypatch):
    monkeypatch.setattr(FIND_SIMPLEST, lambda is_wanted: None)
    (tmp_path / "ropes.py").write_text(ROPE.replace("FACTOR", factor))
    result = carom("plugins", "check", "ropes.py")
    assert result.exit_code == code, (result.stdout, result.stderr, result.exception)
    said = refusal(result) if code == 2 else result.stdout
    assert ("row 0: its value changes by" in said) is ("turns by moment(arm, push)" in said) is bool(code)
    assert code == 2 or sum(line.startswith("joint Rope") and " 400 " in line for line in said.splitlines()) == 1
