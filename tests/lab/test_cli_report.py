"""Output of ``carom run``: energy, bodies that escaped, faults, times of the step."""

from __future__ import annotations

import re
from pathlib import Path

import helpers_cli
import pytest
from helpers_cli import report_of
from helpers_processes import copied_cache, run_carom

from carom.lab.cli.run import fault_lines

carom, ball = helpers_cli.carom, helpers_cli.ball  # fixtures


def test_json_is_the_only_output_and_holds_what_the_table_shows(carom):
    report = report_of(carom("run", "gas2d", "--steps", "20", "--json", "--no-pictures", "--seed", "4"))
    assert (report["scene"], report["seed"], report["steps"]) == ("gas2d", 4, 20)
    assert report["simulated_seconds"] == pytest.approx(20 / 60)
    assert report["bodies"] == {"total": 1004, "dynamic": 1000, "kinematic": 0, "static": 4}
    assert report["contacts"]["impacts"] > 0
    assert report["step_milliseconds"] > 0
    assert 0 < sum(report["system_milliseconds"].values()) <= report["step_milliseconds_mean"]
    assert abs(report["energy"]["relative"]) < 1e-11
    assert report["energy_changes"] == []
    assert report["escaped"] == {"outside": 0, "non_finite": 0}
    assert report["deepest_overlap"] < 1.0
    assert report["pictures"] == []


def test_energy_drift_is_measured_against_the_largest_kinetic_energy(carom, ball):
    """Explicit Euler gains m g (g dt t / 2) in free fall, by position; the scale is m (g t)^2 / 2."""
    explicit = ("--set", "integrator=explicit_euler")
    report = report_of(carom("run", "ball.py", "--steps", "30", *explicit, "--json", "--no-pictures"))
    assert report["energy"]["relative"] == pytest.approx((1 / 60) / 0.5, rel=1e-9)


def test_text_of_others_is_no_markup(carom, ball):
    """Faults, names of systems and of files: brackets and colons are as they were written."""
    ball.write_text(
        ball.read_text().replace(
            "    return world",
            "    world.add_system(Door())\n    return world\n\n"
            "from carom import System\n\n"
            "class Door(System):\n    name = 'door [/b]'\n\n    def process(self, dt):\n"
            "        self.world.report_fault('door [/open] is [red] :key:')",
        )
    )
    ball = ball.rename("[red] [.py")
    shown = carom("run", str(ball), "--steps", "2").stdout
    for text in ("! door [/open] is [red] :key:", "picture: out/[red] [-final.png", "door [/b]"):
        assert text in shown


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


@pytest.mark.slow
def test_bodies_that_are_not_finite_are_counted_and_the_rest_is_still_drawn(carom, ball):
    """1e200 m/s: the kinetic energy overflows at once, the position after some steps of 1e150 s."""
    fast = "    world.create_entity(Transform((5, 5)), RigidBody(linear_velocity=(1e200, 0)))"
    ball.write_text(ball.read_text().replace("    return world", f"{fast}\n    return world"))
    result = carom("run", "ball.py", "--steps", "3", "--set", "dt=1e150", "--json")
    report = report_of(result)
    assert not {"NaN", "Infinity"} & set(result.stdout.split())
    assert report["energy"]["start"] is None
    assert report["escaped"]["non_finite"] >= 1
    shown = carom("run", "ball.py", "--steps", "3", "--no-pictures").stdout
    assert "not representable" in shown
    assert "nan" not in shown


def test_the_worlds_faults_are_shown(carom, ball):
    """A body between two elastic walls without space to move bounces more often than a step allows."""
    text = ball.read_text().replace(
        "SphereCollider(radius=0.5)", "SphereCollider(radius=0.5, restitution=1.0)"
    )
    text = text.replace("gravity=(0.0, -9.81)", "gravity=(0.0, 0.0)").replace("(seed, 10)", "(0, 1.001)")
    text = text.replace("mass=2.0", "linear_velocity=(0, 100)")
    wall = "    world.create_entity(Transform((0, 2.01)), AABBCollider(half_extents=(50, 0.5)))"
    ball.write_text(text.replace("    return world", f"{wall}\n    return world"))
    result = carom("run", "ball.py", "--steps", "3", "--no-pictures")
    assert result.exit_code == 0, result.stderr
    assert "impacts beyond 64 of a body in one step" in result.stdout


@pytest.mark.slow
def test_the_progress_says_what_compiles(tmp_path):
    """The names of kernels appear while they compile; of two here, the others are in the cache."""
    cache = copied_cache(tmp_path / "cache", "sum_forces", "match_warm_start")
    arguments = ("run", "jump", "--no-pictures", "--steps", "60")
    result = run_carom(*arguments, cwd=tmp_path, FORCE_COLOR="1", **cache)  # rich then animates into the pipe
    assert result.returncode == 0, result.stderr
    assert "compiling" in result.stderr
    assert "match_warm_start" in result.stderr
    assert "100%" in result.stderr


@pytest.mark.slow
def test_energy_that_is_not_conserved_says_why(carom):
    result = carom("run", "jump", "--no-pictures")
    for words in ("restitution below 1", "everything else", "escaped bodies +0 "):
        assert re.search(words, result.stdout)
    report = report_of(carom("run", "billiards", "--steps", "300", "--json", "--no-pictures"))
    assert report["energy_changes"] == ["restitution below 1", "damping"]
    report = report_of(carom("run", "car", "--steps", "30", "--json", "--no-pictures"))
    assert "joints that drive, spring or stop" in report["energy_changes"]


@pytest.mark.slow
def test_energy_that_is_kept_has_no_reason_to_change(carom):
    """Boxes at rest: their restitution is 0, and no impact has taken anything."""
    result = carom("run", "stack", "--no-pictures")
    assert "490 J" in result.stdout
    assert "changed by" not in result.stdout


def test_a_system_may_have_changed_the_energy(carom, ball):
    pushed = """
class Push(System):
    def process(self, dt):
        self.world.bodies.dynamic.linear_velocity[:] *= 1.5
"""
    text = ball.read_text().replace("def build", f"from carom.framework import System\n{pushed}\ndef build", 1)
    ball.write_text(text.replace("    return world", "    world.add_system(Push())\n    return world"))
    report = report_of(carom("run", "ball.py", "--steps", "9", "--json", "--no-pictures"))
    assert "systems of the game" in report["energy_changes"]
    assert "restitution below 1" not in report["energy_changes"]


TOUCHED = """
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, System, World
from carom.plugins import Physics


class Coin(Component):
    pass


class Take(System):
    def process(self, dt):
        for coin, _, _ in self.world.contacts.begin.pairs(Coin, RigidBody):
            self.world.delete_entity(coin)


def build(settings, seed=0):
    world = World(Physics(dimensions=2), settings=settings)
    world.add_system(Take())
    world.create_entity(Transform((0, 0)), RigidBody(), AABBCollider((0.5, 0.5)))
    world.create_entity(Transform((0.2, 0)), SphereCollider(0.3, sensor=True), Coin())
    world.create_entity(Transform((5, 0)), AABBCollider((1, 1)))
    world.create_entity(Transform((5.5, 0)), RigidBody(kind="kinematic"), AABBCollider((1, 1)))
    world.create_entity(Transform((-0.2, 0)), AABBCollider((0.3, 0.3), sensor=True))
    return world
"""


def test_neither_sensors_nor_what_is_taken_nor_a_platform_in_a_wall_is_an_overlap(carom):
    Path("touched.py").write_text(TOUCHED)
    report = report_of(carom("run", "touched.py", "--steps", "3", "--json", "--no-pictures"))
    assert report["bodies"]["static"] == 2
    assert report["contacts"]["most"] == 3
    assert report["deepest_overlap"] == 0


def test_faults_of_one_kind_share_a_line():
    fast = [f"entity {number}: too fast: set its ccd" for number in range(3433, 3438)]
    faults = [*fast, "entity 7: not finite", "no room left"]
    assert fault_lines(faults) == [
        "entities 3433, 3434, 3435 and 2 more, each: too fast: set its ccd", "entity 7: not finite", "no room left",
    ]  # fmt: skip
    assert fault_lines([f"fault {n}" for n in "abcde"])[3:] == ["and 2 other faults"]


def test_forces_from_outside_change_the_momentum(carom):
    result = carom("run", "spring", "--steps", "9", "--no-pictures")
    assert "energy drift" in result.stdout
    assert "momentum" not in result.stdout
