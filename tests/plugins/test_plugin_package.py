"""A third-party plugin: a package built, installed, found, checked and used."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.early]  # its shapes take long to compile

PROJECT = """
[build-system]
requires = ["setuptools>=68"]
build-backend = "setuptools.build_meta"

[project]
name = "{name}"
version = "{version}"

[project.entry-points."carom.plugins"]
{point} = "{value}"

[tool.setuptools]
packages = ["{package}"]
"""
SHAPE = '''
from carom.components import SphereCollider
from carom.components.colliders import Collider
from carom.framework import Plugin, column
from carom.framework.vectors import divided, length, scale

plugin = Plugin("diamonds", version="2.5")

@plugin.shape(cost=3)
class DiamondCollider(Collider):
    dimensions = (2,)
    size = column(positive=True)
    def bounds(shape, dimensions):
        return shape.size, shape.size

@plugin.pair(DiamondCollider, SphereCollider)
def diamond_sphere(a, b, d):
    distance = length(d)
    depth = a.size + b.radius - distance
    normal = divided(d, distance) if distance > 0.0 else (1.0, 0.0)
    return depth >= 0.0, depth, normal, scale(normal, a.size - 0.5 * depth)
'''
START = """
import json
from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.framework.compilation import log
from carom.framework.plugins.discovery import find
from carom.plugins import Physics
from diamonds_package.shapes import DiamondCollider

world = World(Physics(gravity=(0.0, -9.81)), find("diamonds"))
world.create_entity(Transform((0, 0)), DiamondCollider(1.0))
"""
GAME = START + """
ball = world.create_entity(Transform((0.5, 2)), RigidBody(), SphereCollider(0.25, restitution=1.0))
while not world.contacts.impacts and world.step_count < 120:
    world.step()
impact = world.contacts.impacts
print(json.dumps({"normal": impact.normal[0].tolist(), "step": world.step_count, "a": impact.entity_a.tolist()}))
"""


def write_package(folder: Path, name: str, version: str, point: str, value: str, files: dict[str, str]) -> Path:
    package = value.partition(":")[0].partition(".")[0]
    (folder / package).mkdir(parents=True)
    text = PROJECT.format(name=name, version=version, point=point, value=value, package=package)
    (folder / "pyproject.toml").write_text(text, encoding="utf-8")
    for file, content in {"__init__.py": "", **files}.items():
        (folder / package / file).write_text(content, encoding="utf-8")
    return folder


def install(source: Path, target: Path) -> None:
    """Install into a separate folder, without a network."""
    options = ["--no-build-isolation", "--no-deps", "--no-index", "--quiet", "--disable-pip-version-check"]
    command = [sys.executable, "-m", "pip", "install", *options, "--target", str(target), str(source)]
    result = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": ""})
    assert result.returncode == 0, result.stderr


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """A folder with a good plugin's package and a broken one's."""
    base = tmp_path_factory.mktemp("third-party")
    files = {"shapes.py": SHAPE}
    good = write_package(
        base / "good", "diamonds-package", "0.3", "diamonds", "diamonds_package.shapes:plugin", files
    )
    bad = write_package(
        base / "bad", "broken-package", "0.1", "broken", "broken_package.it:plugin", {"it.py": "import no_such_thing\n"}
    )
    target = base / "site"
    install(good, target)
    install(bad, target)
    return target


@pytest.fixture(scope="module")
def python(site, tmp_path_factory):
    """Runs Python with that folder on its path, in an empty working folder."""
    empty = tmp_path_factory.mktemp("empty")

    def run(*arguments: str, cache: Path | None = None, site: Path = site) -> subprocess.CompletedProcess[str]:
        path = os.pathsep.join([str(site), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {**os.environ, "PYTHONPATH": path, "COLUMNS": "180"}
        if cache is not None:
            environment["CAROM_CACHE_DIR"] = str(cache)
        command = [sys.executable, *arguments]
        return subprocess.run(command, capture_output=True, text=True, env=environment, cwd=empty)

    return run


def row_of(output: str, start: str) -> str:
    return next(line for line in output.splitlines() if line.startswith(start))


def test_an_installed_plugin_is_listed_and_a_broken_one_stops_nothing(python):
    result = python("-m", "carom", "plugins")
    assert result.returncode == 0, result.stderr
    row = row_of(result.stdout, "diamonds")
    for part in ("2.5", "diamonds-package", "DiamondCollider and SphereCollider"):
        assert part in row
    assert "broken: ModuleNotFoundError: No module named 'no_such_thing'" in row_of(result.stdout, "broken")


def test_an_installed_plugin_is_checked_by_its_name(python):
    result = python("-m", "carom", "plugins", "check", "diamonds")
    assert result.returncode == 0, result.stdout + result.stderr
    assert "ok" in row_of(result.stdout, "pair DiamondCollider and SphereCollider")
    assert "no pair with AABBCollider, DiamondCollider" in result.stdout
    result = python("-m", "carom", "plugins", "check", "broken")
    assert result.returncode == 2
    assert "plugin 'broken' of package broken-package cannot be loaded" in result.stderr


def test_a_ball_falls_on_its_shape_and_bounces(python):
    """Half a metre beside the middle of a disc of 1 m: centres 1.25 m apart when a ball of 0.25 m touches."""
    result = python("-c", GAME)
    assert result.returncode == 0, result.stderr
    said, height = json.loads(result.stdout.splitlines()[-1]), (1.25**2 - 0.5**2) ** 0.5
    assert said["normal"] == pytest.approx([0.5 / 1.25, height / 1.25], abs=1e-2)
    assert abs(said["step"] - (2 * (2.0 - height) / 9.81) ** 0.5 * 60) <= 1.0
