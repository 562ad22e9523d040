"""The wheel with compiled kernels, installed elsewhere: a game that has it compiles nothing."""

from __future__ import annotations

import base64
import hashlib
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from helpers_packages import build, copied_sources
from helpers_processes import NATIVE, NO_COMPILER, with_variables
from packaging.tags import cpython_tags
from packaging.utils import parse_wheel_filename

import carom
from carom.framework.jit import libraries as library_module
from carom.framework.jit.lazy import JIT
from carom.framework.jit.libraries import AVX2, NAME, libraries
from carom.lab.build.build_library import build_library
from carom.lab.build.errors import BuildError
from carom.lab.build.kernels import collect
from carom.lab.build.platforms import PLATFORMS, native
from carom.lab.build.wheel import with_library
from carom.lab.cli.warm_up import shipped_kernels

pytestmark = [pytest.mark.early, pytest.mark.slow, pytest.mark.skipif(not JIT, reason="nothing is compiled")]

PACKAGE = Path(carom.__file__).parent

PLAY = """
import sys
from functools import partial
from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.framework.compilation import log
from carom.plugins import Physics, capsule, convex_polygon, tile_grid

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
    for step in range(200 if name == "pile" else 60):
        world.step()
    ask(world)
    print(f"{name}: {world.state_hash()} compiled {len(log.compiled)} later {len(log.compiled) - before[0]}")
print("kernels", [kernel for kernel, _ in log.compiled])
"""


def run(*command, cwd=None, **environment):
    command, environment = [sys.executable, *map(str, command)], with_variables(environment)
    done = subprocess.run(command, env=environment, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done


@pytest.fixture(scope="module")
def pure(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pure")
    return build("wheel", copied_sources(folder / "source"), folder)


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """The one of this checkout, if nothing was edited since."""
    shipped = [function for dimensions in (2, 3) for function in shipped_kernels(dimensions)]
    for own in libraries():
        if Path(own.path).parent == PACKAGE and all(own.holds(each.symbol, each.py_func) for each in shipped):
            return Path(own.path)
    made = tmp_path_factory.mktemp("library") / f"{NAME}{native().suffix}"
    try:
        build_library(collect((), "generic", everything=True), made, native(), compared=True)
    except BuildError as error:
        pytest.skip(str(error))
    return made


@pytest.mark.parametrize("name", PLATFORMS)
def test_a_wheel_of_each_platform_is_one_that_installers_take(name, pure, tmp_path):
    """Whatever version of Python: the first and one to come. Its list of files has the digest of each."""
    library = tmp_path / f"{NAME}{PLATFORMS[name].suffix}"
    library.write_bytes(b"machine code")
    made = with_library(pure, library, PLATFORMS[name], tmp_path)
    tags = parse_wheel_filename(made.name)[3]
    machine = {
        "linux-x86_64": "manylinux_2_17_x86_64", "linux-aarch64": "musllinux_1_1_aarch64",
        "macos-arm64": "macosx_11_0_arm64", "win-amd64": "win_amd64", "wasm32": "pyodide_2024_0_wasm32",
    }[name]  # fmt: skip
    for minor in (11, 12, 31):
        assert tags & set(cpython_tags((3, minor), [f"cp3{minor}"], [machine]))
    assert not tags & set(cpython_tags((3, 10), ["cp310"], [machine]))
    with zipfile.ZipFile(made) as archive:
        files = {file: archive.read(file) for file in archive.namelist()}
    with zipfile.ZipFile(pure) as archive:
        assert {*files} == {*archive.namelist(), f"carom/{library.name}"}
    (information,) = {file.partition("/")[0] for file in files if ".dist-info/" in file}
    lines = files[f"{information}/WHEEL"].decode().splitlines()
    assert sorted(line for line in lines if line.startswith("Tag: ")) == sorted(f"Tag: {tag}" for tag in tags)
    assert "Root-Is-Purelib: false" in lines
    recorded = dict(line.split(",", 1) for line in files[f"{information}/RECORD"].decode().splitlines())
    assert recorded.pop(f"{information}/RECORD") == ","
    del files[f"{information}/RECORD"]
    digests = {file: base64.urlsafe_b64encode(hashlib.sha256(content).digest()) for file, content in files.items()}
    assert recorded == {file: f"sha256={d.decode().rstrip('=')},{len(files[file])}" for file, d in digests.items()}


@pytest.fixture(scope="module")
def played(pure, library, tmp_path_factory):
    """What games print that have the wheel, no compiler and no home."""
    folder = tmp_path_factory.mktemp("player")
    site, home = folder / "site", folder / "home"
    wheel = with_library(pure, library, native(), folder)
    run("-m", "pip", "install", "--no-deps", "--target", site, wheel)
    home.mkdir()
    places = {"PYTHONPATH": str(site), "HOME": str(home), "XDG_CACHE_HOME": "", "CAROM_CACHE_DIR": ""}
    printed = run("-c", NO_COMPILER + PLAY, cwd=folder, CAROM_LIBRARY=None, **places).stdout.splitlines()
    assert not list(home.iterdir())
    return printed


def test_games_with_the_wheel_compile_nothing(played):
    assert played[-1] == "kernels []"


@pytest.mark.parametrize("processor", ["any", pytest.param("this", marks=pytest.mark.long)])
def test_they_keep_the_bits_of_the_sources(played, tmp_path, processor):
    """Of one scene with impacts, friction and rest. To compile it for this processor takes most of a minute, and
    jit/test_checked_build.py does so with all indices checked."""
    compiled = {"CAROM_CACHE_DIR": str(tmp_path), **NATIVE} if processor == "this" else {}
    here = run("-c", PLAY, "pile", cwd=tmp_path, CAROM_LIBRARY="0", **compiled).stdout.splitlines()
    assert (here[-1] == "kernels []") == (processor == "any")
    assert here[0].split(" compiled")[0] == played[1].split(" compiled")[0]
    assert here[0].startswith("pile: ")


@pytest.mark.skipif(not native() or not native().is_x86, reason="other processors have no AVX2")
def test_only_processors_with_avx2_run_what_is_made_for_it(tmp_path, monkeypatch):
    """That it has the same bits is told where the wheel plays the scenes of scenes/test_scene_hashes.py."""
    generic, wide = (collect((), each, everything=True, names=("begin_impacts",)) for each in ("generic", "x86-64-v3"))
    file = tmp_path / f"{NAME}{native().suffix}"
    try:
        build_library(generic, file, native(), compared=False, wide=wide)
    except BuildError as error:
        pytest.skip(str(error))
    module = library_module._opened(str(file))
    assert {f"{kernel.symbol}{AVX2}" for kernel in wide} <= {*module.addresses}
    assert len(wide) == 2
    for has, behind in ((True, AVX2), (False, "")):
        monkeypatch.setitem(library_module.__cpu_features__, "AVX2", has)
        chosen = library_module.Library(module).addresses
        assert all(chosen[kernel.symbol] == module.addresses[kernel.symbol + behind] for kernel in wide)
