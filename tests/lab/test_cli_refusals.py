"""Errors of the ``carom`` command: one line that names the mistake and its place."""

from __future__ import annotations

from pathlib import Path

import helpers_cli
import pytest
from helpers_cli import refusal

carom, ball = helpers_cli.carom, helpers_cli.ball  # fixtures


@pytest.mark.parametrize(("arguments", "words"), [
    (["run", "asteroid"], ["no scene named 'asteroid'", "did you mean 'asteroids'?"]),
    (["run", "folder/thing"], ["'folder/thing' is no scene, and no Python file"]),
    (["run", "."], ["'.' is no scene"]),
    (["run"], ["Missing argument"]),
    (["rum", "jump"], ["'rum'"]),
    (["run", "jump", "--step", "3"], ["--step", "--steps"]),
    (["run", "jump", "--steps", "many"], ["--steps", "many"]),
    (["run", "jump", "--seconds", "nan"], ["--seconds", "'nan' is not a finite number"]),
    (["run", "jump", "--seconds", "-1/2"], ["--seconds", "-0.5 is not in the range"]),
    (["run", "jump", "--steps", "3", "--seconds", "1"], ["--steps and --seconds"]),
    (["run", "jump", "--seed", "x"], ["--seed", "'x'"]),
    (["run", "jump", "--settings", "acurate"], ["'acurate'", "'accurate'"]),
    (["run", "jump", "--set", "substep=3"], ["no field 'substep'", "did you mean 'substeps'?"]),
    (["run", "jump", "--set", "substeps=three"], ["--set: Settings.substeps must be a whole number", "'three'"]),
    (["run", "jump", "--set", "dt=1/0"], ["--set: Settings.dt must be a finite number above 0", "'1/0'"]),
    (["run", "jump", "--steps", "abc"], ["'--steps': 'abc' is not a valid whole number"]),
    (["run", "jump", "--seed", "1.5"], ["'--seed': '1.5' is not a valid whole number"]),
    (["run", "jump", "--set", "substeps"], ["'substeps' is not NAME=VALUE"]),
    (["run", "jump", "--set", "restitution_mixing=maxx"], ["'maxx'", "did you mean 'max'"]),
    (["run", "jump", "--set", "integrator=verlet"], ["verlet", "velocity_verlet"]),
], ids=lambda value: " ".join(value[1:]) if value and value[0] in {"run", "rum"} else "")  # fmt: skip
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
        ("def biuld(settings=None, seed=0): ...\n", ["defines no build(settings, seed=0)"]),
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


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("import waves\nimport numppy\n", "scene.py, line 2"),
        ("import waves\nwaves.wave(0)\n", "scene.py, in waves.py, line 4"),
        ("import waves\nwaves.wave('a')\n", "scene.py, in waves.py, line 4"),  # inside of numpy
        ("from foes.big import ogre\n", "scene.py, in {}, line 2"),
        ("def build(settings=None, seed=0):\n    import waves\n    waves.wave(0)\n", "scene.py, in waves.py, line 4"),
    ],
)
def test_an_error_in_a_module_beside_the_file_names_the_line_of_that(carom, tmp_path, text, place):
    (tmp_path / "foes").mkdir()
    (tmp_path / "foes" / "big.py").write_text("\nogre = 1 / 0\n")
    (tmp_path / "waves.py").write_text(
        "import numpy as np\n\ndef wave(n):\n    return np.linspace(0, 1 / n, 3) if n == 0 else np.linspace(0, 1, n)\n"
    )
    (tmp_path / "scene.py").write_text(text if "build" in text else f"{text}def build(settings=None, seed=0): ...\n")
    line = refusal(carom("run", "scene.py", "--no-pictures"))
    assert line.startswith(f"carom: {place.format(Path('foes') / 'big.py')}: ")


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


@pytest.mark.parametrize("group", [[], ["maps"]])
def test_a_group_without_arguments_shows_its_help(carom, group):
    result = carom(*group)
    assert (result.exit_code, result.stdout, result.stderr) == (0, carom(*group, "--help").stdout, "")


def test_what_stops_a_build_is_one_line_too(carom, capfd):
    assert carom("build", "bal.py").exit_code == 2
    assert capfd.readouterr().err == "carom: no file 'bal.py'\n"


def test_missing_file_suggests_its_neighbour(carom, ball):
    assert "did you mean 'ball.py'?" in refusal(carom("run", "bal.py"))


def test_traceback_on_request(carom, tmp_path):
    (tmp_path / "scene.py").write_text("raise RuntimeError('no luck')\ndef build(settings, seed=0): ...\n")
    result = carom("run", "scene.py", "--traceback")
    assert result.exit_code != 0
    assert result.exception is not None
    assert "no luck" in str(result.exception)
