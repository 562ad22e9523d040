"""Kernels out of libraries: a game's own, built by ``carom build``, played where there is no compiler."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import types
from pathlib import Path

import pytest
from helpers_folders import game_of_the_page
from helpers_processes import NO_COMPILER, run_carom, with_variables

from carom.framework.jit import libraries as library_module
from carom.framework.jit.hash import PYTHON, writing_digest
from carom.framework.jit.kinds import FLOAT
from carom.framework.jit.lazy import JIT
from carom.framework.jit.libraries import LAYOUT, Library, file_name, platform_name, short_hash
from carom.framework.jit.names import symbol_of

pytestmark = [pytest.mark.slow, pytest.mark.early, pytest.mark.skipif(not JIT, reason="nothing is compiled")]


def python(folder: Path, code: str, **environment: str | None) -> subprocess.CompletedProcess[str]:
    """What a player's Python says: no home, no cache, no folder that can be written to but its own."""
    nowhere = {"HOME": str(folder), "XDG_CACHE_HOME": None, "CAROM_CACHE_DIR": str(folder / "cache")}
    nowhere["CAROM_LIBRARY"] = None
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, cwd=folder, env=with_variables({**nowhere, **environment}), capture_output=True, text=True, check=False
    )


def play(folder: Path, before: str = "", after: str = "", **environment: str | None) -> str:
    code = f"{before}\nimport runpy\nnames = runpy.run_path('jewels.py', run_name='__main__')\n{after}"
    done = python(folder, code, **environment)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


@pytest.fixture(scope="module")
def game(tmp_path_factory) -> Path:
    """The game of the page, built as the page says."""
    folder = tmp_path_factory.mktemp("game")
    (folder / "jewels.py").write_text(game_of_the_page(), encoding="utf-8")
    done = run_carom("build", "jewels.py", cwd=folder)
    if "there is no linker" in done.stderr:
        pytest.skip(done.stderr)
    assert done.returncode == 0, done.stderr
    assert f"kernels/{file_name(platform_name())}: " in done.stdout
    return folder


def test_it_plays_without_a_compiler_as_with_one(game, tmp_path):
    """The same state after 1,000 steps, from a folder that knows nothing of the compiler's."""
    shutil.copytree(game, tmp_path, dirs_exist_ok=True)
    alone = play(tmp_path, NO_COMPILER, "print([name for name in sys.modules if 'numba' in name])").splitlines()
    compiled = play(game, CAROM_CACHE_DIR=os.environ["CAROM_CACHE_DIR"], CAROM_LIBRARY="0").splitlines()
    assert alone[0].split()[0] == compiled[0].split()[0]
    assert alone[0].split()[1:] == ["0", "kernels", "compiled"]
    assert alone[1] == "[]"


WINDY = """
from __future__ import annotations
import numpy as np
from carom import Physics, RigidBody, SphereCollider, System, Transform, World, use_kernels
from carom.framework.compilation import kernel

use_kernels("kernels")

class Calm(ValueError):
    pass

@kernel
def doubled(steps: int) -> int:
    return 2 * steps

@kernel
def blow(velocity, strength, steps: int):
    if strength[0] != strength[0]:
        raise Calm("no wind is blowing")
    for i in range(len(velocity)):
        velocity[i, 0] += strength[i % 2] / (1.0 + doubled(steps))

class Wind(System):
    steps = 0
    strength = np.array((1.0, 2.0))

    def process(self, dt):
        assert doubled(self.steps) == 2 * self.steps
        blow(self.world.bodies.dynamic.linear_velocity, self.strength, self.steps)
        self.steps += 1

def build(settings=None, seed=0):
    world = World(Physics(dimensions=2), settings=settings)
    for k in range(3):
        world.create_entity(Transform((2 * k, 0)), RigidBody(), SphereCollider(0.5))
    world.add_system(Wind())
    return world

if __name__ == "__main__":
    world = build()
    for _ in range(50):
        world.step()
    print(world.state_hash())
"""


def test_kernels_of_systems_that_get_arrays_are_in_the_library_too(game, tmp_path):
    file = tmp_path / "jewels.py"  # as play runs it
    file.write_text(WINDY, encoding="utf-8")
    for _ in range(2):  # once more, with those that there are: the library is whole again
        done = run_carom("build", "jewels.py", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    error = """
Wind = names["Wind"]
Wind.strength = names["np"].array((float("nan"), 2.5))
try:
    names["build"]().step()
except Exception as error:
    print(error)
try:
    names["blow"](names["np"].zeros(3, np.float32), Wind.strength, 1)
except Exception as error:
    print(type(error).__name__, error)
""".replace("np.float32", 'names["np"].float32')
    alone = play(tmp_path, NO_COMPILER, error).splitlines()
    assert alone[0] == play(tmp_path).splitlines()[0]
    assert "Calm: no wind is blowing" in alone[1]
    kinds = "(array(float32,1,C,), array(float64,1,C,), int64)"
    assert alone[2].startswith(f"LibraryError kernel blow for {kinds} is in no library")
    file.write_text(WINDY.replace("1.0 + doubled", "2.0 + doubled"), encoding="utf-8")
    done = python(tmp_path, f"{NO_COMPILER}\nimport runpy\nrunpy.run_path('jewels.py', run_name='__main__')")
    assert "kernel blow for" in done.stderr
    assert "is in no library" in done.stderr


def test_errors_of_its_functions_arrive_with_text_and_values(game):
    one_place = """
import numpy as np
from carom import Transform
world = names["build"]()
post, jewel = (world.create_entity(Transform((50, 50)), names["RigidBody"]()) for _ in range(2))
leash = world.create_entity(names["Leash"](post, jewel, 2.5))
try:
    world.step()
except Exception as error:
    print(type(error).__name__, error)
"""
    said = play(game, NO_COMPILER, one_place).splitlines()[-1]
    assert "ValueError" in said
    assert "a leash between two bodies in one place, so long:" in said
    assert "2.5" in said


def test_what_was_edited_compiles_and_nothing_else(game, tmp_path):
    shutil.copytree(game, tmp_path, dirs_exist_ok=True)
    file = tmp_path / "jewels.py"
    before = file.read_text(encoding="utf-8")
    file.write_text(before.replace("return length(way), scale", "return 1.0 * length(way), scale"), encoding="utf-8")
    told = "from carom.framework.compilation import log\nprint([name for name, _ in log.compiled])"
    said = play(tmp_path, after=told)
    assert said.splitlines()[-1] == "['given']"


def test_what_was_not_built_is_named_before_anything_moves(game):
    more = """
from carom import Transform
from carom.plugins import capsule
world = names["build"]()
plugin = names["Plugin"]("pebbles", version="1.0")

@plugin.shape(cost=1)
class Pebble(names["Collider"]):
    dimensions = (2,)
    radius = names["column"](positive=True)
    bounds, support = names["Jewel"].bounds, names["Jewel"].support

world.add_plugin(plugin)
world.create_entity(Transform((0, 50)), names["RigidBody"](), Pebble(0.5))
for needs in (world.prepare, world.step):
    try:
        needs()
    except Exception as error:
        print(type(error).__name__, error)
"""
    said, stepping = play(game, NO_COMPILER, more).splitlines()[-2:]
    assert re.match("LibraryError plugin pebbles: [a-z]+ of Pebble", stepping)  # no other pair is blamed
    assert said.startswith("LibraryError plugin")
    assert "Pebble" in said
    assert "pip install numba, or build the game anew" in said


DAMAGES = {
    "half": "is not whole", "other": f"has no kernels for {platform_name()}", "none": "has no kernels for",
    "version": "was built by another version of carom", "text": "cannot be loaded",
}  # fmt: skip


def test_a_library_that_cannot_be_used_is_told_in_a_line(game, tmp_path):
    for damage in DAMAGES:
        shutil.copytree(game / "kernels", tmp_path / damage)
        (file,) = (tmp_path / damage).iterdir()
        whole = file.read_bytes()
        if damage == "half":
            file.write_bytes(whole[: len(whole) // 2])
        elif damage == "other":
            file.rename(tmp_path / damage / file_name("macos-arm64"))
        elif damage == "none":
            file.unlink()
        elif damage == "version":
            file.write_bytes(whole.replace(b"layout\0", b"lay_ut\0"))
        else:
            file.write_bytes(b"no library at all")
    code = f"""
from carom import use_kernels
for damage in {[*DAMAGES]}:
    try:
        use_kernels(damage)
    except Exception as error:
        print(type(error).__name__, error)
"""
    said = python(tmp_path, code).stdout.splitlines()
    assert len(said) == len(DAMAGES)
    for line, words in zip(said, DAMAGES.values(), strict=True):
        assert line.startswith("LibraryError ")
        assert words in line


def test_names_are_the_same_in_every_process_and_without_the_compiler():
    code = """
from carom.framework.plugins.registry import Registry
from carom.plugins import Physics, capsule, joints, rotation
from carom.systems.linking.preparation import all_functions
registry = Registry()
for plugin in (Physics(2), capsule.plugin, joints.Joints(), rotation.Rotation()):
    registry.add(plugin)
print(sorted(function.symbol for function in all_functions(registry, 2)))
"""
    printed = {
        subprocess.run(
            [sys.executable, "-c", before + code], env=with_variables({"PYTHONHASHSEED": seed}), capture_output=True,
            text=True, check=True,
        ).stdout for before, seed in (("", "1"), (NO_COMPILER, "2"))
    }  # fmt: skip
    assert len(printed) == 1
    names = printed.pop()
    assert names.count("carom_") > 100


class Module(types.ModuleType):
    """In place of the extension module: a library of one function, made from this one."""

    def __init__(self, symbol, function, **facts):
        super().__init__("_kernels")
        self.__file__ = "a library"
        self.addresses = {symbol: 1}
        hashes = json.dumps({symbol: short_hash(function)})
        self.facts = {"layout": LAYOUT, "python": PYTHON, "writing": writing_digest(), "hashes": hashes, **facts}

    def set_error_handler(self, handler):
        pass


def times(factor):
    def product(x):
        return x * factor

    return product


def test_of_two_functions_by_one_name_a_library_holds_that_which_it_was_made_from():
    """As when a function is defined again, in a notebook, or its module reloaded."""

    def defined(shift):
        def add(x, shift=shift):
            return x + shift

        return add

    one, other = defined(1.0), defined(2.0)
    symbol = symbol_of(one, FLOAT(FLOAT))
    assert symbol == symbol_of(other, FLOAT(FLOAT))
    library = Library(Module(symbol, one))
    assert library.holds(symbol, one)
    assert not library.holds(symbol, other)


def test_a_library_made_before_carom_wrote_other_machine_code_holds_nothing():
    made = times(2.0)
    symbol = symbol_of(made, FLOAT(FLOAT))
    held = [
        Library(Module(symbol, made, **facts)).holds(symbol, made)
        for facts in ({}, {"writing": "by others"}, {"writing": "by others", "hashes": "{}"}, {"writing": ""})
    ]
    assert held == [True, False, True, True]  # a wheel's has no hashes; in a packed game there are no sources


def test_a_library_of_another_version_of_carom_is_refused(game):
    code = "import carom\ncarom.__version__ = '0.0.9'\ncarom.use_kernels('kernels')"
    last = python(game, code).stderr.splitlines()[-1]
    assert re.search(r"was built by carom \S+, this is 0\.0\.9: build it again", last)


@pytest.mark.parametrize("has", [True, False])
def test_a_library_of_a_checkout_is_for_processors_that_can_run_it(monkeypatch, has):
    """It may have been built on another machine; where AVX2 is missing its code would end the process."""
    facts = {"layout": LAYOUT, "python": PYTHON, "writing": writing_digest(), "hashes": '{"of": "all"}'}
    module = types.SimpleNamespace(
        facts=facts | {"features": "+avx2"}, addresses={}, set_error_handler=lambda handler: None, __file__="own"
    )
    monkeypatch.setattr(library_module.importlib.util, "find_spec", lambda name: types.SimpleNamespace(origin="own"))
    monkeypatch.setattr(library_module, "_opened", lambda path: module)
    monkeypatch.setitem(library_module.__cpu_features__, "AVX2", has)
    assert [library.path for library in library_module._own.__wrapped__()] == ["own"] * has
