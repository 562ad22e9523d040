"""The wheel with compiled kernels, installed elsewhere: a game that has it compiles nothing."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from helpers_processes import NATIVE, with_variables

pytestmark = pytest.mark.early

ROOT = Path(__file__).resolve().parents[2]
LEFT_OUT = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "dist", "out", "tests", "docs")

PLAY = """
import sys
from functools import partial
from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.framework.compilation import log
from carom.plugins import Physics, capsule, convex_polygon, tile_grid

STEPS = 200

def platformer(mode):
    plugins = capsule.plugin, convex_polygon.plugin, tile_grid.plugin
    world = World(Physics(2, gravity=(0.0, -9.81)), *plugins, settings=Settings(collision=mode))
    ground = ["#........#", "#........#", "#..##....#", "##########"]
    world.create_entity(Transform((0.0, 0.0)), tile_grid.TileGridCollider(ground, 1.0))
    world.create_entity(Transform((0.0, 1.0)), AABBCollider((1.0, 0.0), one_way=(0.0, 1.0)))
    for k in range(3):
        place = Transform((-1.0 + k, 4.0 + k))
        world.create_entity(place, RigidBody(linear_velocity=(1.0, 0.0)), capsule.CapsuleCollider(0.2, 0.3))
        corners = convex_polygon.ConvexPolygonCollider([(-0.3, -0.3), (0.3, -0.3), (0.0, 0.4)], restitution=0.5)
        world.create_entity(Transform((-1.0 + k, 6.0 + k)), RigidBody(), corners)
        world.create_entity(Transform((-1.0 + k, 8.0 + k)), RigidBody(), SphereCollider(0.2, restitution=0.8))
        world.create_entity(Transform((-1.0 + k, 9.0 + k)), RigidBody(), AABBCollider((0.2, 0.2), friction=0.5))
    return world

def ask(world):
    d = world.dimensions
    origin, ahead = (0.0,) * d, (1.0,) + (0.0,) * (d - 1)
    world.ray_cast(origin, ahead)
    world.query_sphere(origin, 3.0)
    world.query_nearest(origin)
    world.shape_cast(SphereCollider(0.5), origin, ahead)

worlds = {
    "asteroids": scenes.get("asteroids").build,
    "pile": lambda: scenes.get("pile2d").build(n=100),
    "gas3d": lambda: scenes.get("gas3d").build(n=200),
    "pile3d": lambda: scenes.get("pile3d").build(n=50),
    **{f"platformer {mode}": partial(platformer, mode) for mode in ("discrete", "continuous", "event_driven")},
}
for name, build in worlds.items():
    if name not in (sys.argv[1:] or worlds):
        continue
    world = build()
    world.step()
    before = len(log.compiled), log.loaded
    for step in range(STEPS if "platformer" not in name else 120):
        world.step()
    ask(world)
    print(f"{name}: {world.state_hash()} compiled {len(log.compiled)} later {len(log.compiled) - before[0]}")
for name in scenes.names() if len(sys.argv) == 1 else ():
    world = scenes.get(name).build()
    for step in range(10):
        world.step()
    ask(world)
print("kernels", [kernel for kernel, _ in log.compiled])
"""


def run(*command, cwd=None, **environment):
    command, environment = [sys.executable, *map(str, command)], with_variables(environment)
    done = subprocess.run(command, env=environment, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Built from a copy of the sources, as ``make wheel`` does, with the kernels that the tests run."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    shutil.copytree(ROOT, source, symlinks=True, ignore=LEFT_OUT)
    run("-m", "carom", "warm-up", "--portable", source / "framework" / "prebuilt")
    run("-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, source)
    (made,) = folder.glob("carom-*.whl")
    return made


@pytest.mark.slow
def test_the_wheel_is_of_this_platform_and_carries_the_kernels(wheel):
    version = f"cp{sys.version_info.major}{sys.version_info.minor}"
    assert f"-{version}-{version}-" in wheel.name
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert "carom/framework/prebuilt/index.json" in names
    assert sum(name.endswith(".kernel") for name in names) > 100


@pytest.fixture(scope="module")
def played(wheel, tmp_path_factory):
    """What games print that have the wheel and no kernels of their own."""
    folder = tmp_path_factory.mktemp("player")
    site, home = folder / "site", folder / "home"
    run("-m", "pip", "install", "--no-deps", "--target", site, wheel)
    home.mkdir()
    place = {"PYTHONPATH": str(site), "HOME": str(home), "XDG_CACHE_HOME": "", "CAROM_CACHE_DIR": "", **NATIVE}
    printed = run("-c", PLAY, cwd=folder, **place).stdout.splitlines()
    assert not list(home.rglob("*.kernel"))
    return printed


@pytest.mark.slow
def test_games_with_the_wheel_compile_nothing(played):
    assert played[-1] == "kernels []"


@pytest.mark.slow
@pytest.mark.parametrize("processor", ["any", pytest.param("this", marks=pytest.mark.long)])
def test_they_keep_the_bits_of_the_sources(played, tmp_path, processor):
    """Of one scene with impacts, friction and rest. To compile it for this processor takes most of a minute, and
    jit/test_checked_build.py does so with all indices checked."""
    compiled = {"CAROM_CACHE_DIR": str(tmp_path), **NATIVE} if processor == "this" else {}
    here = run("-c", PLAY, "pile", cwd=tmp_path, CAROM_PREBUILT="0", **compiled).stdout.splitlines()
    assert (here[-1] == "kernels []") == (processor == "any")
    assert here[0].split(" compiled")[0] == played[1].split(" compiled")[0]
    assert here[0].startswith("pile: ")
