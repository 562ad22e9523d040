"""``carom limits``: how long the step of a scene may be."""

from __future__ import annotations

from pathlib import Path

import helpers_cli
import pytest
from helpers_cli import refusal, report_of

carom = helpers_cli.carom  # fixture

IMPORTS = """
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, System, World
from carom.plugins import Physics

"""
SPRING = IMPORTS + """
seconds = 0.1


class Pull(ForceSystem):
    def add_forces(self, bodies, time):
        bodies.force -= 2500.0 * bodies.position


def build(settings, seed=0):
    world = World(Physics(dimensions=2), settings=settings)
    world.create_entity(Transform((1, 0)), RigidBody())
    world.add_system(Pull())
    return world
"""


@pytest.mark.slow
def test_the_command_tells_the_limits_of_a_scene(carom):
    """50 rad/s: 2 / 50 s; a third smaller for Yoshida's method, none for explicit Euler."""
    Path("spring.py").write_text(SPRING)
    result = carom("limits", "spring.py")
    assert result.exit_code == 0, result.output
    assert "entity 1 swings at 50 rad/s; semi_implicit_euler holds it up to dt = 0.04 s." in result.stdout
    assert "is too long" in carom("limits", "spring.py", "--set", "dt=0.05", "--seconds", "0").stdout
    unstable = carom("limits", "spring.py", "--set", "integrator=explicit_euler", "--seconds", "0")
    assert "No step is stable" in unstable.stdout
    plain = report_of(carom("limits", "spring.py", "--json", "--set", "integrator=yoshida4"))
    assert plain["scene"] == "spring.py"
    assert plain["tightest"]["stability"] == pytest.approx(1.5734 / 50, rel=1e-4)
    assert plain["tightest"]["tunnelling"] is None


def test_the_command_watches_a_scene_of_the_library(carom):
    """Billiards: the cue ball is fast from the start; two balls of 0.05715 m overlap over twice that."""
    result = carom("limits", "billiards", "--seconds", "0.1")
    assert result.exit_code == 0, result.output
    assert "overlap on a way of 0.1143 m" in result.stdout


FALLS = IMPORTS + """
seconds = 1.0

def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0, -10)), settings=settings)
    world.create_entity(Transform((9, 9)), RigidBody(), SphereCollider(0.1))
    world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.1))
    return world

def compared(world):
    return {"height": world.bodies.position[1, 1]}
"""


def test_half_of_the_step_shows_how_far_bodies_end_elsewhere(carom):
    """Semi-implicit Euler is off by g dt t / 2 in free fall: half of the step by half of that, 4.2 cm after 1 s. Two
    balls of 0.2 m that fall at 10 m/s may meet at 20 m/s: over 0.4 m."""
    Path("falls.py").write_text(FALLS)
    report = report_of(carom("limits", "falls.py", "--json"))
    assert report["half"]["farthest"] == pytest.approx(10 / 60 / 4, rel=1e-9)
    assert report["half"]["compared"]["height"] == [pytest.approx([-5 - 5 / 60]), pytest.approx([-5 - 5 / 120])]
    assert report["start"]["suggested"] is None
    assert (report["tightest"]["time"], report["suggested"]) == (pytest.approx(1.0), pytest.approx(0.9 * 0.4 / 20))
    shown = carom("limits", "falls.py").stdout
    assert "After 1 s with half of the step entity 1 ends 4.2 cm from where it does, the farthest." in shown
    assert "height: -5.083, with half of the step -5.042." in shown


BROKEN_ON_THE_WAY = IMPORTS + """
import numpy as np

class Spoiler(System):
    def process(self, dt):
        if self.world.time > 0.5:
            self.world.bodies.linear_velocity[0] = np.nan

def build(settings, seed=0):
    world = World(Physics(dimensions=2), settings=settings)
    world.add_system(Spoiler())
    world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(1, 0)), SphereCollider(0.3))
    return world
"""


def test_the_command_tells_what_broke_while_it_watched(carom, tmp_path):
    """A world with non-finite numbers must not be reported as one without limits."""
    file = tmp_path / "broken.py"
    file.write_text(BROKEN_ON_THE_WAY)
    result = carom("limits", str(file), "--seconds", "2")
    assert result.exit_code == 2
    assert "broken.py: not finite after 0.6 s: entity 1: linear_velocity is [nan, nan]" in result.output


LATER = IMPORTS + """
seconds = 0.1

class Later(System):
    def process(self, dt):
        if self.world.step_count == COMES:
            self.world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.3))

def build(settings, seed=0):
    world = World(Physics(dimensions=2), settings=settings)
    world.add_system(Later())
    world.create_entity(Transform((0, 5)), AABBCollider(half_extents=(1, 1)))
    return world
"""


def test_what_moves_may_come_while_it_watches(carom):
    Path("still.py").write_text(LATER.replace("COMES", "-1"))
    refused = refusal(carom("limits", "still.py"))
    assert refused == "carom: still.py: there is no body that moves by itself: nothing to measure"
    Path("later.py").write_text(LATER.replace("COMES", "3"))
    assert "Nothing limits the step" in carom("limits", "later.py").stdout


@pytest.mark.parametrize(("arguments", "message"), [
    (["stack", "--seconds", "-1"], "'--seconds': -1.0 is not in the range x>=0"),
    (["stak"], "no scene named 'stak'; did you mean 'stack'"),
    ([], "Missing argument"),
])  # fmt: skip
def test_the_command_refuses_in_one_line(carom, arguments, message):
    assert message in refusal(carom("limits", *arguments))


