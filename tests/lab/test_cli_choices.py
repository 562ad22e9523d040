"""Arguments of the ``carom`` command: a scene or a file, its settings, seconds, seed."""

from __future__ import annotations

import subprocess
import sys

import helpers_cli
import pytest
from helpers_cli import refusal, report_of

from carom import __version__, scenes
from carom.framework import Settings

carom, ball = helpers_cli.carom, helpers_cli.ball  # fixtures


def test_settings_come_from_the_scene_then_the_preset_then_set(carom):
    def settings(*arguments):
        return report_of(carom("run", "billiards", "--steps", "1", "--json", "--no-pictures", *arguments))[
            "settings"
        ]

    assert settings()["dt"] == pytest.approx(1 / 960)
    assert settings("--settings", "accurate")["substeps"] == Settings.accurate().substeps
    changed = settings("--set", "substeps=7", "--set", "restitution_threshold=0.25", "--set", "sleeping=true")
    assert (changed["dt"], changed["substeps"], changed["restitution_threshold"]) == (1 / 960, 7, 0.25)
    assert changed["sleeping"] is True
    assert settings("--set", "slop=0.1", "--set", "slop=None")["slop"] is None


@pytest.mark.slow
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
    (tmp_path / "components.py").write_text("SPEED = 3.0\n")  # also the name of a package of carom
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


@pytest.mark.slow
def test_version_and_python_dash_m():
    result = subprocess.run(
        [sys.executable, "-m", "carom", "--version"], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == f"carom, version {__version__}"


def test_a_file_gets_settings_to_change(carom, ball):
    text = ball.read_text().replace("settings=settings or Settings.balanced()", "settings=settings.replace(dt=1 / 30)")
    ball.write_text(text)
    report = report_of(carom("run", "ball.py", "--steps", "1", "--json", "--no-pictures"))
    assert report["settings"]["dt"] == 1 / 30


@pytest.mark.parametrize(("old", "new"), [
    ("settings or Settings.balanced()", "settings or Settings(substeps=8)"),
    ("def build(settings=None", "def build(settings=Settings(substeps=8)"),
    ("def build", "SETTINGS = Settings(substeps=8)\n\ndef build"),
])  # fmt: skip
def test_the_settings_that_a_file_has_itself(carom, ball, old, new):
    """They are what the command line changes."""
    text = ball.read_text()
    assert old in text
    ball.write_text(text.replace(old, new))
    for changes, dt in ((), 1 / 60), (("--set", "dt=1/90"), 1 / 90):
        report = report_of(carom("run", "ball.py", "--steps", "1", "--json", "--no-pictures", *changes))
        assert (report["settings"]["substeps"], report["settings"]["dt"]) == (8, dt)


def test_a_file_without_build_is_not_executed(carom, tmp_path):
    (tmp_path / "game.py").write_text("def build_level(): pass\nopen('played', 'w').close()\nwhile True: pass\n")
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


@pytest.mark.slow
def test_a_file_says_its_view_and_its_seconds(carom, ball):
    text = ball.read_text()
    ball.write_text(f"{text}\nseconds = 0.25\nview = ((-5, -1), (5, 12))\n")
    assert report_of(carom("run", "ball.py", "--json"))["steps"] == 15
    ball.write_text(f"{text}\nview = ((-5, -1, 0), (5, 12, 1))\n")
    assert "3 dimensions" in refusal(carom("run", "ball.py"))
    ball.write_text(f"{text}\nview = 7\n")
    assert "view must be" in refusal(carom("run", "ball.py"))
