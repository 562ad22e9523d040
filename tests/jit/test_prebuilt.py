"""Kernels that came compiled: loaded where they fit, left alone with one line where they do not."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from helpers_processes import NATIVE, copied_cache, run_carom, run_python

from carom.framework.jit.prebuilt import INDEX, PORTABLE, made_with

MAIN = """
import logging, sys
logging.basicConfig(format="%(message)s", stream=sys.stderr)
from carom.framework.compilation import kernel, log
from carom.framework.jit.prebuilt import use_kernels, write_index

@kernel
def shifted(x):
    return x * {factor} + 1.0

for folder in sys.argv[1:]:
    use_kernels(folder)
print(shifted(2.0), len(log.compiled), log.loaded)
"""
EMPTY_GAME = """
from carom.framework import World
from carom.framework.compilation import kernel
from carom.plugins import Physics

@kernel
def shifted(x):
    return x + 1.0

def build(settings=None, seed=0):
    shifted(2.0)
    return World(Physics(2), settings=settings)
"""
WRITE = "import pathlib; write_index(pathlib.Path({folder!r}), {processor!r})"


class Game:
    """A program with one kernel, and the folder that it ships."""

    def __init__(self, folder):
        self.folder, self.shipped = folder, folder / "kernels"
        self.shipped.mkdir()
        environment = {
            "CAROM_CACHE_DIR": str(self.shipped), "NUMBA_CPU_NAME": PORTABLE[0], "NUMBA_CPU_FEATURES": PORTABLE[1],
        }  # fmt: skip
        write = WRITE.format(folder=str(self.shipped), processor=PORTABLE)
        assert self.run(code=f"{MAIN}{write}\n", shipped=[], **environment)[:3] == (5.0, 1, 0)
        self.shipped.chmod(0o755)

    def run(self, code=MAIN, factor=2.0, shipped=None, anew=False, **environment):
        """(result, compiled, loaded, lines of stderr) in a process with an empty cache of its own."""
        cache = self.folder / "cache"
        shutil.rmtree(cache, ignore_errors=True)
        folders = [self.shipped] if shipped is None else shipped
        environment = {"CAROM_CACHE_DIR": str(cache), **environment}
        done = run_python(code.format(factor=factor), *folders, anew=anew, **environment)
        assert done.returncode == 0, done.stderr
        result, compiled, loaded = done.stdout.split()
        return float(result), int(compiled), int(loaded), done.stderr.splitlines()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return Game(tmp_path_factory.mktemp("game"))


@pytest.fixture
def game(made, tmp_path):
    """A copy, to break."""
    copied = object.__new__(Game)
    copied.folder, copied.shipped = tmp_path, tmp_path / "kernels"
    shutil.copytree(made.shipped, copied.shipped)
    return copied


def test_a_process_of_any_processor_loads_what_was_shipped(game):
    assert game.run(anew=True, **NATIVE) == (5.0, 0, 1, [])


def test_a_kernel_that_was_edited_since_compiles(game):
    assert game.run(factor=3.0)[:3] == (7.0, 1, 0)


def test_a_missing_or_damaged_kernel_compiles(game):
    (file,) = game.shipped.glob("*.kernel")
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])
    assert game.run()[:3] == (5.0, 1, 0)
    file.unlink()
    assert game.run()[:3] == (5.0, 1, 0)


def with_index(game, name, text):
    """A copy of the shipped folder whose index is this text; None: without an index."""
    folder = game.folder / name
    shutil.copytree(game.shipped, folder)
    (folder / INDEX).unlink()
    if text is not None:
        (folder / INDEX).write_text(text)
    return folder


def test_what_was_made_with_another_version_or_is_damaged_is_left_alone_and_told_in_one_line(game):
    reasons = {}
    for name in made_with():
        index = json.loads((game.shipped / INDEX).read_text())
        reason = f"they were made with {name} another, here {index['made_with'][name]}"
        index["made_with"][name] = "another"
        reasons[with_index(game, f"other {name}", json.dumps(index))] = reason
    assert len(reasons) > 3
    for k, text in enumerate((None, "", "{", "[]", '{"made_with": {}}')):
        reasons[with_index(game, f"damaged {k}", text)] = "index.json is missing or damaged"
    result, compiled, loaded, lines = game.run(shipped=list(reasons))
    assert (result, compiled, loaded) == (5.0, 1, 0)
    for folder, reason in reasons.items():
        (told,) = [line for line in lines if f"{folder} " in line]
        assert told.startswith(f"carom: the kernels in {folder} are not used")
        assert reason in told


def test_they_can_be_switched_off(game):
    assert game.run(CAROM_PREBUILT="0")[:3] == (5.0, 1, 0)


@pytest.mark.slow
def test_the_command_takes_what_the_cache_holds_and_nothing_else(tmp_path):
    """The first time its own kernel compiles; the second time nothing does, and the same files are copied."""
    environment = copied_cache(tmp_path / "cache")
    (tmp_path / "cache" / "other-1234.kernel").write_bytes(b"of another program")
    (tmp_path / "game.py").write_text(EMPTY_GAME)
    contents = []
    for folder in ("first", "second"):
        done = run_carom("warm-up", "game.py", "--portable", folder, cwd=tmp_path, **environment)
        assert done.returncode == 0, done.stderr
        assert ("compiling kernels" in done.stderr) == (folder == "first")
        contents.append({file.name: file.read_bytes() for file in (tmp_path / folder).iterdir()})
    assert contents[0] == contents[1]
    assert any(name.startswith("shifted-") for name in contents[0])
    assert "other-1234.kernel" not in contents[0]


def test_the_command_refuses_a_folder_that_holds_other_things(tmp_path):
    (tmp_path / "letter.txt").write_text("keep me")
    done = run_carom("warm-up", "--portable", tmp_path)
    assert done.returncode == 2
    assert "holds other things" in done.stderr
    assert (tmp_path / "letter.txt").exists()


# Its clock tells every frame to have taken its time at once.
WITHOUT_WAITING = """
import runpy, sys
import pygame

class Clock:
    def tick(self, rate):
        return 1000 / rate

pygame.time.Clock = Clock
sys.argv.pop(0)
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def test_the_game_of_the_manual_runs_as_written(tmp_path):
    """docs/ship-your-game.md, without a display: 120 frames, and it says what it has compiled."""
    pytest.importorskip("pygame")
    page = (Path(__file__).resolve().parents[2] / "docs" / "ship-your-game.md").read_text(encoding="utf-8")
    (tmp_path / "bricks.py").write_text(page.partition("```python no-run\n")[2].partition("```")[0])
    environment = {"SDL_VIDEODRIVER": "dummy", "SDL_AUDIODRIVER": "dummy"}
    done = run_python(WITHOUT_WAITING, "bricks.py", "120", cwd=tmp_path, **environment)
    assert done.returncode == 0, done.stderr
    frames, bricks = done.stdout.splitlines()[-1].split(", ")[:2]
    assert frames == "120 frames"
    assert 0 < int(bricks.split()[0]) < 36
