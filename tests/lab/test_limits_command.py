"""``carom limits``: how long the step of a scene may be."""

from __future__ import annotations

import json
import pickle
from contextlib import closing
from pathlib import Path

import helpers_cli
import pytest
from helpers_cli import refusal

from carom.lab.trading.subject import Subject

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


def test_the_command_tells_the_limits_of_a_scene(carom):
    """50 rad/s: 2 / 50 s; a third smaller for Yoshida's method, none for explicit Euler."""
    Path("spring.py").write_text(SPRING)
    result = carom("limits", "spring.py")
    assert result.exit_code == 0, result.output
    assert "entity 1 swings at 50 rad/s; semi_implicit_euler holds it up to dt = 0.04 s." in result.stdout
    assert carom("limits", "spring.py", "--set", "integrator=rk4").stdout.startswith("spring.py: dt up to 1/")
    assert "Weakest link: at 1/" in result.stdout
    assert "is too long" in carom("limits", "spring.py", "--set", "dt=0.05", "--seconds", "0").stdout
    unstable = carom("limits", "spring.py", "--set", "integrator=explicit_euler", "--seconds", "0")
    assert "no step is stable" in unstable.stdout
    plain = json.loads(carom("limits", "spring.py", "--json", "--set", "integrator=yoshida4").stdout)
    assert plain["scene"] == "spring.py"
    assert plain["tightest"]["stability"] == pytest.approx(1.5734 / 50, rel=1e-4)
    assert plain["tightest"]["tunnelling"] is None


def test_the_command_watches_a_scene_of_the_library(carom):
    """Billiards: the cue ball is fast from the start; two balls of 0.05715 m overlap over twice that."""
    result = carom("limits", "billiards", "--seconds", "0.1")
    assert result.exit_code == 0, result.output
    assert "overlap on a way of 0.1143 m" in result.stdout


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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stack", "--seconds", "-1"], "'--seconds': -1.0 is not in"),
        (["stack", "--max-error", "0"], "'--max-error': 0.0 is not in"),
        (["stak"], "no scene named 'stak'; did you mean 'stack'"),
        ([], "Missing argument"),
    ],
)
def test_the_command_refuses_in_one_line(carom, arguments, message):
    assert message in refusal(carom("limits", *arguments))


FALLS = IMPORTS + """
seconds = 1.0

def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0, -10)), settings=settings)
    world.create_entity(Transform((0, 0)), RigidBody())
    return world
"""


SLIDES = IMPORTS + """
seconds = 0.3

def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0, -10)), settings=settings)
    world.create_entity(Transform((0, -0.5)), AABBCollider((5, 0.5)))
    world.create_entity(Transform((0, 0.5)), RigidBody(linear_velocity=(1, 0)), AABBCollider((0.5, 0.5)))
    world.create_entity(Transform((4, -0.5)), RigidBody(1.0, (-1, 0), kind="kinematic"), AABBCollider((0.5, 0.3)))
    return world
"""


def test_the_step_follows_the_error_that_is_asked_for(carom):
    """Semi-implicit Euler is off by g dt t / 2 in free fall: after 1 s 8 cm at 1/60 s, 1 cm at 1/480 s."""
    Path("falls.py").write_text(FALLS)
    steps = []
    for most in ("0.1", "0.02"):
        result = carom("limits", "falls.py", "--max-error", most, "--json")
        assert result.exit_code == 0, result.output
        steps.append(json.loads(result.stdout)["outcome"]["longest"])
    for step, most in zip(steps, (0.1, 0.02), strict=True):
        assert 5 * step <= most < 5 * 2 * step
    assert "moves no body by more than 10 cm, and" in carom("limits", "falls.py", "--max-error", "0.1").stdout
    Path("game.py").write_text(FALLS + "\n\ndef compared(world):\n    return {'height': 1.0}\n")
    assert "says itself what counts" in refusal(carom("limits", "game.py", "--max-error", "0.1"))


def test_a_platform_that_moves_through_the_floor_is_no_overlap(carom):
    Path("slides.py").write_text(SLIDES)
    result = carom("limits", "slides.py")
    assert result.exit_code == 0, result.output
    assert "Known from " in result.stdout
    assert "sink" not in result.stdout


def test_a_scene_with_options_is_measured_in_other_processes_too():
    asked = pickle.loads(pickle.dumps(Subject("gas2d", "gas2d", changes=(("substeps", 3),), plugins=("springs",))))
    with closing(asked.world(None)) as world:
        assert world.settings.substeps == 3
        assert any(plugin.name == "springs" for plugin in world.plugins)
    with closing(asked.world(world.settings.replace(substeps=2))) as other:
        assert other.settings.substeps == 2
