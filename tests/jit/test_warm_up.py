"""``carom warm-up``: what it compiles, prints and refuses."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner
from helpers_processes import copied_cache, run_carom

from carom.framework.jit.cache import cache_folder
from carom.lab.cli import warm_up
from carom.lab.cli.main import cli

FALLING = """
from carom.components import RigidBody, Transform
from carom.framework import World
from carom.plugins import Physics

def build(settings=None, seed=0):
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), settings=settings)
    world.create_entity(Transform((0, 10)), RigidBody())
    print("falling")
    return world
"""
LACKS = {"semi_implicit_euler", "sum_forces"}


@pytest.fixture
def carom(tmp_path):
    """The command, in separate processes with a separate cache that lacks some kernels."""
    (tmp_path / "falling.py").write_text(FALLING)
    environment = copied_cache(tmp_path / "kernels", *LACKS)
    return lambda *arguments: run_carom("warm-up", *arguments, cwd=tmp_path, **environment)


@pytest.mark.slow
def test_the_second_time_everything_is_there_already(carom, tmp_path):
    there = len(list((tmp_path / "kernels").glob("*.kernel")))
    first = carom("falling.py", "--json")
    assert first.returncode == 0, first.stderr
    report = json.loads(first.stdout)
    (row,) = report["targets"]
    assert row["target"] == "falling.py"
    assert {kernel for kernel, _ in row["compiled"]} >= LACKS
    assert all(0 < seconds <= row["seconds"] for _, seconds in row["compiled"])
    files = list((tmp_path / "kernels").glob("*.kernel"))
    size = sum(path.stat().st_size for path in files)
    assert report["cache"] == {
        "folder": str(tmp_path / "kernels"), "kernels_before": there, "kernels": len(files), "bytes": size,
    }  # fmt: skip
    assert len(files) == there + len(row["compiled"])
    assert "compiling kernels" in first.stderr
    assert str(tmp_path / "kernels") in first.stderr

    second = carom("falling.py")
    assert second.returncode == 0, second.stderr
    needed = row["found"] + len(row["compiled"])
    assert second.stdout.splitlines()[1].split()[:3] == ["falling.py", "0", str(needed)]
    assert f"{len(files):,} kernels" in second.stdout.splitlines()[-1]
    assert "compiling kernels" not in second.stderr

    cleared = carom("--clear")
    assert cleared.returncode == 0, cleared.stderr
    assert cleared.stdout.startswith(f"{len(files):,} kernels deleted from {tmp_path / 'kernels'} (")
    assert not list((tmp_path / "kernels").iterdir())
    assert json.loads(carom("--clear", "--json").stdout)["cache"]["kernels_before"] == 0


def names_of_work(monkeypatch, *arguments):
    """The command's pieces of work, in order."""
    done = []
    monkeypatch.setattr(warm_up, "shipped_kernels", lambda d: f"all that ships {d}")
    monkeypatch.setattr(warm_up, "link_all", done.append)
    monkeypatch.setattr(warm_up, "_prepare_scene", lambda loaded: done.append(loaded.name))
    result = CliRunner().invoke(cli, ["warm-up", *arguments])
    assert result.exit_code == 0, result.stderr
    return done


@pytest.mark.slow
def test_what_is_to_be_compiled_can_be_chosen(monkeypatch):
    assert names_of_work(monkeypatch) == ["all that ships 2", "all that ships 3"]
    assert names_of_work(monkeypatch, "--dimensions", "3") == ["all that ships 3"]
    assert names_of_work(monkeypatch, "jump", "gas2d") == ["jump", "gas2d"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["jumpp"], "did you mean 'jump'?"),
        (["jump", "jumpp"], "did you mean 'jump'?"),
        (["--clear", "jump"], "--clear goes alone"),
        (["--clear", "--dimensions", "2"], "--clear goes alone"),
        (["jump", "--dimensions", "2"], "--dimensions and scenes exclude each other"),
        (["--dimensions", "4"], "'4' is not one of"),
    ],
)
def test_refusals_come_before_anything_compiles(monkeypatch, arguments, words):
    monkeypatch.setattr(warm_up, "_prepare_scene", lambda loaded: pytest.fail("compiled"))
    result = CliRunner().invoke(cli, ["warm-up", *arguments])
    assert result.exit_code == 2
    assert result.stdout == ""
    assert words in result.stderr.splitlines()[-1]


@pytest.mark.slow
def test_a_scene_that_fails_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.py").write_text("def build(settings=None, seed=0):\n    raise ValueError('no such level')\n")
    result = CliRunner().invoke(cli, ["warm-up", "bad.py"])
    assert result.exit_code == 2
    assert "bad.py, line 2: no such level" in result.stderr


def test_without_a_folder_there_is_nothing_to_warm(monkeypatch):
    monkeypatch.setattr(warm_up, "cache_folder", lambda: None)
    result = CliRunner().invoke(cli, ["warm-up"])
    assert result.exit_code == 2
    assert "CAROM_CACHE_DIR" in result.stderr
    assert cache_folder() is not None
