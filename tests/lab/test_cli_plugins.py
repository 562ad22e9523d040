"""``carom plugins``, ``carom plan`` and ``--plugin`` for plugin authors."""

from __future__ import annotations

import importlib
import json

import helpers_cli_plugins
import pytest
from helpers_cli_plugins import BALL, OFFERED, ROOT, offer, refusal, row_of

from carom.framework import Plugin
from carom.lab.plugins.command import plugins_of

pytestmark = pytest.mark.slow  # its shapes take long to compile

carom = helpers_cli_plugins.carom  # a fixture

SCENE = """
from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.plugins import Physics

def build(settings=None, seed=0):
    world = World(Physics(gravity=(0.0, -9.81)), settings=settings)
    world.create_entity(Transform((0, 10)), RigidBody(), SphereCollider(0.5))
    return world
"""


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
    assert [plugin.name for plugin in plugins_of("balls")] == ["balls"]


def test_broken_ones_are_shown_and_do_not_stop_the_command(carom, tmp_path, monkeypatch):
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
    assert "'chekc'" in refusal(carom("plugins", "chekc"))


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
