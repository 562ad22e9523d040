"""The cache of compiled kernels, by programs in processes of their own: reused, never stale, never an obstacle."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from helpers_processes import start_python

FILES = {
    "helpers.py": """
import enum
import numpy as np
import deeper
from carom.framework.compilation import part

TABLE = np.array([0.0, 1.0])
FACTOR = 2.0

class Level(enum.IntEnum):
    TOP = 0

@part
def scaled(x):
    return FACTOR * x

@part
def helper(x):
    return scaled(x) + 1.0
""",
    "deeper.py": "SHIFT = 0.0\n",
}
MAIN = """
import sys
sys.path.insert(0, {folder!r})
import numpy as np
from carom.framework.compilation import kernel, log
from carom.framework.jit.hash import deep_hash
sys.dont_write_bytecode = True  # of a file that is edited within its second
import helpers
from helpers import helper

def make(shift):
    @kernel
    def total(values):
        result = shift + helpers.TABLE[0] + helpers.Level.TOP.value + helpers.deeper.SHIFT
        for value in values:
            result += helper(value)
        return result
    return total

total, other = make(0.0), make(100.0)
print(total(np.arange(3.0)), other(np.arange(3.0)), len(log.compiled), log.loaded, deep_hash(total))
"""


class Program:
    """Files of which one calls what the others have, run in processes of their own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.cache = folder / "cache"
        self.sources = dict(FILES)
        self.stderr = ""  # of the last run
        self.main = MAIN.format(folder=str(folder))

    def start(self, **more):
        for name, text in self.sources.items():
            (self.folder / name).write_text(text)
        return start_python(self.main, cwd=self.folder, **{"CAROM_CACHE_DIR": str(self.cache), **more})

    def run(self, **more) -> tuple[float, float, int, int, str]:
        """Results of both kernels, numbers of compiled and loaded kernels, and the hash of the first."""
        return self.result(self.start(**more))

    def result(self, process) -> tuple[float, float, int, int, str]:
        done = process.finish()
        self.stderr = done.stderr
        assert done.returncode == 0, self.stderr
        first, second, compiled, loaded, digest = done.stdout.split()
        return float(first), float(second), int(compiled), int(loaded), digest

    def files(self) -> list[Path]:
        return sorted(self.cache.glob("*.kernel"))


@pytest.fixture
def program(tmp_path):
    return Program(tmp_path)


@pytest.fixture(scope="module")
def first_run(tmp_path_factory):
    program = Program(tmp_path_factory.mktemp("program"))
    assert program.run()[:4] == (9.0, 109.0, 2, 0)
    return program


@pytest.fixture
def compiled(first_run, program):
    """A program that has run once."""
    shutil.copytree(first_run.cache, program.cache)
    return program


@pytest.mark.slow
def test_a_second_process_loads_what_the_first_has_compiled(program):
    """Kernels made by a factory, closures over each other: numba's own cache never finds these again."""
    first = program.run(anew=True, PYTHONHASHSEED="1")
    assert first[:4] == (9.0, 109.0, 2, 0)
    assert len(program.files()) == 2
    second = program.run(anew=True, PYTHONHASHSEED="2")
    assert second[:4] == (9.0, 109.0, 0, 2)
    assert second[4] == first[4]


CALLER = """
@kernel
def twice(values):
    return 2.0 * total(values)

print(total(np.arange(3.0)), twice(np.arange(3.0)), len(log.compiled), log.loaded, "numba.np.linalg" in sys.modules)
"""


@pytest.mark.slow
def test_loading_reads_nothing_of_numbas_own_functions_and_a_loaded_kernel_compiles_into_another(compiled):
    """They take .7 s and 50 MB, and what loads has no need of them; the first kernel that compiles has."""
    before = compiled.main
    compiled.main = before.replace("deep_hash(total)", "'numba.np.linalg' in sys.modules")
    assert compiled.run(anew=True) == (9.0, 109.0, 0, 2, "False")
    compiled.main = before[: before.index("print(")] + CALLER
    assert compiled.run(anew=True) == (9.0, 18.0, 1, 1, "True")


EDITS = [
    ("helpers.py", "FACTOR * x", "FACTOR * x * x", 13.0),  # two calls deep, in another file
    ("helpers.py", "FACTOR = 2.0", "FACTOR = 3.0", 12.0),  # a constant there
    ("helpers.py", "[0.0,", "[100.0,", 109.0),  # an array of a module
    ("helpers.py", "TOP = 0", "TOP = 9", 18.0),  # an enumeration
    ("deeper.py", "SHIFT = 0.0", "SHIFT = 4.0", 13.0),  # a module of a module
]


@pytest.mark.slow
def test_an_edit_of_what_a_kernel_calls_or_reads_in_another_file_is_noticed(compiled):
    """Undone it finds the old one; one of a comment compiles nothing, and a switch of numba everything."""
    for file, old, new, expected in EDITS:
        compiled.sources = {**FILES, file: FILES[file].replace(old, new)}
        assert compiled.run()[:3] == (expected, expected + 100.0, 2)
    compiled.sources = {name: f"# a remark\n{text}" for name, text in FILES.items()}
    assert compiled.run()[:3] == (9.0, 109.0, 0)
    for switch in ({"NUMBA_BOUNDSCHECK": "1"}, {"NUMBA_OPT": "1"}):
        assert compiled.run(**switch)[:4] == (9.0, 109.0, 2, 0)
    assert compiled.run()[:4] == (9.0, 109.0, 0, 2)


FIELDS = """
import collections
from carom.framework.compilation import kernel, log

Rock = collections.namedtuple("Rock", {fields!r})

@kernel
def size(rock):
    return rock[0] + 10.0 * rock[1]

@kernel
def width(rock):
    return rock.width

print(width(Rock(1.0, 2.0)), size(Rock(1.0, 2.0)), len(log.compiled), log.loaded, "-")
"""


@pytest.mark.slow
def test_named_tuples_of_one_name_with_swapped_fields_are_two_types(program):
    program.main = FIELDS.format(fields="width height")
    assert program.run()[:2] == (1.0, 21.0)
    program.main = FIELDS.format(fields="height width")
    assert program.run()[:3] == (2.0, 21.0, 2)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="permissions of files")
def test_a_folder_that_others_may_write_to_is_refused_before_it_is_read(compiled):
    for mode in (0o770, 0o707):
        compiled.cache.chmod(mode)
        home = {"HOME": str(compiled.folder / f"home {mode}"), "XDG_CACHE_HOME": ""}
        assert compiled.run(**home)[:4] == (9.0, 109.0, 2, 0)
        assert "others may write to it" in compiled.stderr
        assert f"chmod go-w {compiled.cache}" in compiled.stderr
    compiled.cache.chmod(0o700)
    assert compiled.run(**home)[2:4] == (0, 2)


@pytest.mark.slow
def test_a_variable_that_names_a_file_is_told_in_one_line(program):
    program.cache.write_text("not a folder")
    home = {"HOME": str(program.folder / "home"), "XDG_CACHE_HOME": ""}
    assert program.run(**home)[:2] == (9.0, 109.0)
    assert program.stderr.splitlines()[0].startswith(f"carom: compiled kernels are not kept in {program.cache}: ")


def flipped(content: bytes) -> bytes:
    """One bit in the middle, where the machine code is."""
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


@pytest.mark.slow
@pytest.mark.parametrize(
    "damages",
    [(lambda _: b"", lambda _: b"garbage" * 20), (lambda content: content[: len(content) // 2], flipped)],
    ids=["empty, garbage", "cut short, one bit"],
)
def test_a_damaged_file_is_compiled_again_and_replaced(compiled, damages):
    for path, damage in zip(compiled.files(), damages, strict=True):
        path.write_bytes(damage(path.read_bytes()))
    assert compiled.run()[:4] == (9.0, 109.0, 2, 0)
    assert compiled.run()[2:4] == (0, 2)


@pytest.mark.slow
def test_without_any_folder_to_write_to_everything_works_and_nothing_is_kept(program):
    blocked = program.folder / "a file"
    blocked.write_text("no folder can be made in here")
    nowhere = str(blocked / "x")
    program.cache = Path(nowhere)
    environment = {"XDG_CACHE_HOME": nowhere, "HOME": nowhere, "TMPDIR": nowhere}
    # tempfile falls back to the current folder if TMPDIR is unusable
    code = f"import tempfile; tempfile.tempdir = {nowhere!r}\n"
    program.main = code + program.main
    for _ in range(2):
        assert program.run(**environment)[:4] == (9.0, 109.0, 2, 0)
        assert program.stderr.count("no folder that can be written") == 1
        assert "CAROM_CACHE_DIR" in program.stderr
        assert "compiled kernels are not kept in" in program.stderr
        assert len(program.stderr.splitlines()) == 2  # why, and what it means
    assert not list(program.folder.rglob("*.kernel"))


@pytest.mark.slow
def test_processes_that_compile_at_once_share_the_folder(program):
    """Each finds whole files or none; both write the same ones."""
    processes = [program.start() for _ in range(2)]
    for process in processes:
        assert program.result(process)[:2] == (9.0, 109.0)
    assert len(program.files()) == 2
    assert not list(program.cache.glob("*.unfinished"))
    assert program.run()[:4] == (9.0, 109.0, 0, 2)


@pytest.mark.slow
def test_the_first_wait_says_in_one_line_what_is_happening_and_later_ones_nothing(program):
    program.run()
    (line,) = program.stderr.splitlines()  # two kernels were compiled
    assert line.startswith("carom: compiling kernels")
    assert str(program.cache) in line
    assert "carom warm-up" in line
    program.run()
    assert program.stderr == ""
