"""The ``carom`` command in an empty folder, a scene file for it, and its output."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from carom.lab.cli.main import cli

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
    """Runs the command in an empty folder, on wide screens; the result has exit_code, stdout and stderr."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def run(*arguments: str):
        return CliRunner().invoke(cli, list(arguments))

    return run


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
