"""The cache of compiled kernels: reused by other processes, never stale, never an obstacle."""

from __future__ import annotations

import gc
import logging
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from helpers_processes import start_python
from numba.core.errors import TypingError

from carom.framework import compilation
from carom.framework.compilation import inlined, kernel, part
from carom.framework.jit import cache as kernel_cache
from carom.framework.jit.cache import cache_contents, cache_folder, clear_cache
from carom.framework.jit.hash import deep_hash

HELPERS = """
from carom.framework.compilation import part

FACTOR = 2.0

@part
def scaled(x):
    return FACTOR * x

@part
def helper(x):
    return scaled(x) + 1.0
"""
MAIN = """
import sys
sys.path.insert(0, {folder!r})
import numpy as np
from carom.framework.compilation import kernel, log
from carom.framework.jit.hash import deep_hash
sys.dont_write_bytecode = True  # of a file that is edited within its second
from helpers import helper

def make(shift):
    @kernel
    def total(values):
        result = shift
        for value in values:
            result += helper(value)
        return result
    return total

total, other = make(0.0), make(100.0)
print(total(np.arange(3.0)), other(np.arange(3.0)), len(log.compiled), log.loaded, deep_hash(total))
"""


class Program:
    """Two files, one calling the other's functions, run in processes of their own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.cache = folder / "cache"
        self.helpers = HELPERS
        self.stderr = ""  # of the last run
        self.main = MAIN.format(folder=str(folder))

    def start(self, **more):
        (self.folder / "helpers.py").write_text(self.helpers)
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


def test_a_second_process_loads_what_the_first_has_compiled(program):
    """Kernels made by a factory, closures over each other: numba's own cache never finds these again."""
    first = program.run(anew=True, PYTHONHASHSEED="1")
    assert first[:4] == (9.0, 109.0, 2, 0)
    assert len(program.files()) == 2
    second = program.run(anew=True, PYTHONHASHSEED="2")
    assert second[:4] == (9.0, 109.0, 0, 2)
    assert second[4] == first[4]


EDITS = [
    ("FACTOR * x", "FACTOR * x * x", 13.0),  # two calls deep, in another file
    ("FACTOR = 2.0", "FACTOR = 3.0", 12.0),  # a constant there
    ("+ 1.0", "+ 2.0", 12.0),
]


def test_an_edit_in_a_function_of_another_file_is_noticed(compiled):
    for old, new, expected in EDITS:
        compiled.helpers = HELPERS.replace(old, new)
        assert compiled.run()[:3] == (expected, expected + 100.0, 2)
    compiled.helpers = HELPERS
    assert compiled.run()[:3] == (9.0, 109.0, 0)  # undoing the edit finds the old one


NAMED = """
import enum
import numpy as np
from types import SimpleNamespace
import deeper
from carom.framework.compilation import part

TABLE = np.array([1.0, 2.0, 3.0])

class Kind(enum.Enum):
    HEAVY = 5

class Level(enum.IntEnum):
    TOP = 7
"""
READS = """
import sys
sys.path.insert(0, {folder!r})
from carom.framework.compilation import kernel, log
sys.dont_write_bytecode = True
import helpers

@kernel
def read(x):
    return helpers.TABLE[0] + helpers.Level.TOP.value + helpers.deeper.FACTOR * x

print(read(1.0), 0.0, len(log.compiled), log.loaded, "-")
"""


READ_EDITS = [
    ("helpers.py", "[1.0,", "[100.0,", 110.0),  # an array of a module
    ("helpers.py", "TOP = 7", "TOP = 9", 13.0),  # an enumeration
    ("deeper.py", "FACTOR = 3.0", "FACTOR = 4.0", 12.0),  # a module of a module
]


def test_an_edit_of_what_a_kernel_reads_from_a_module_is_noticed(program):
    """The reproduction: an edited array helpers.TABLE was not noticed, and the next process ran the former code."""
    program.main = READS.format(folder=str(program.folder))
    deeper = program.folder / "deeper.py"

    def run_with(file="", old="", new=""):
        program.helpers = NAMED.replace(old, new) if file == "helpers.py" else NAMED
        text = "FACTOR = 3.0\n"
        deeper.write_text(text.replace(old, new) if file == "deeper.py" else text)
        return program.run()[:4]

    assert run_with() == (11.0, 0.0, 1, 0)
    assert run_with() == (11.0, 0.0, 0, 1)
    for file, old, new, expected in READ_EDITS:
        assert run_with(file, old, new) == (expected, 0.0, 1, 0)


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


def test_named_tuples_of_one_name_with_swapped_fields_are_two_types(program):
    program.main = FIELDS.format(fields="width height")
    assert program.run()[:2] == (1.0, 21.0)
    program.main = FIELDS.format(fields="height width")
    assert program.run()[:3] == (2.0, 21.0, 2)


def test_switches_of_numba_make_other_files(compiled):
    for switch in ({"NUMBA_BOUNDSCHECK": "1"}, {"NUMBA_DEBUGINFO": "1"}, {"NUMBA_OPT": "1"}):
        assert compiled.run(**switch)[:4] == (9.0, 109.0, 2, 0)
    assert compiled.run()[:4] == (9.0, 109.0, 0, 2)


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


def test_a_variable_that_names_a_file_is_told_in_one_line(program):
    program.cache.write_text("not a folder")
    home = {"HOME": str(program.folder / "home"), "XDG_CACHE_HOME": ""}
    assert program.run(**home)[:2] == (9.0, 109.0)
    assert program.stderr.splitlines()[0].startswith(f"carom: compiled kernels are not kept in {program.cache}: ")


def test_an_edit_of_a_comment_compiles_nothing(compiled):
    compiled.helpers = "# a remark\n" + compiled.helpers
    assert compiled.run()[2] == 0


def flipped(content: bytes) -> bytes:
    """One bit in the middle, where the machine code is."""
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


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


def test_processes_that_compile_at_once_share_the_folder(program):
    """Each finds whole files or none; both write the same ones."""
    processes = [program.start() for _ in range(2)]
    for process in processes:
        assert program.result(process)[:2] == (9.0, 109.0)
    assert len(program.files()) == 2
    assert not list(program.cache.glob("*.unfinished"))
    assert program.run()[:4] == (9.0, 109.0, 0, 2)


def test_a_folder_that_cannot_be_written_is_passed_over(monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("CAROM_CACHE_DIR", str(blocked / "sub"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    assert cache_folder() == tmp_path / "home" / "carom"
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path / "chosen"))
    assert cache_folder() == tmp_path / "chosen"
    assert (tmp_path / "chosen").is_dir()


def test_a_disk_that_fills_up_costs_speed_and_not_the_run(monkeypatch, tmp_path, caplog):
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path))

    def full(*args, **kwargs):
        raise OSError("no space left on device")

    monkeypatch.setattr(kernel_cache.tempfile, "mkstemp", full)

    @kernel
    def twice(x):
        return 2.0 * x

    assert twice(4.0) == 8.0
    assert twice(4) == 8.0
    assert not list(tmp_path.iterdir())
    assert [r.getMessage() for r in caplog.records if "cannot be kept" in r.getMessage()] == [
        f"carom: kernels cannot be kept in {tmp_path}, the next run compiles again: no space left on device"
    ]


def test_a_write_that_breaks_off_leaves_nothing_behind(monkeypatch, tmp_path):
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path))

    def broken(*args):
        raise OSError("connection to the disk lost")

    monkeypatch.setattr(kernel_cache.os, "replace", broken)

    @kernel
    def halved(x):
        return 0.5 * x

    assert halved(4.0) == 2.0
    assert not list(tmp_path.iterdir())


def test_the_folder_can_be_counted_and_emptied(monkeypatch, tmp_path):
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path))
    (tmp_path / "other.txt").write_text("not a kernel")
    (tmp_path / "old.kernel").write_bytes(b"12345")  # of another version
    (tmp_path / "broken.unfinished").write_bytes(b"1")  # of a process that was killed
    assert cache_contents() == (1, 5)
    assert clear_cache() == (1, 5)
    assert cache_contents() == (0, 0)
    assert [path.name for path in tmp_path.iterdir()] == ["other.txt"]


# -- messages --------------------------------------------------------------------------------------------------------


def test_the_first_wait_says_in_one_line_what_is_happening_and_later_ones_nothing(program):
    program.run()
    (line,) = program.stderr.splitlines()  # two kernels were compiled
    assert line.startswith("carom: compiling kernels")
    assert str(program.cache) in line
    assert "carom warm-up" in line
    program.run()
    assert program.stderr == ""


def test_logging_silences_the_line_or_shows_every_kernel(program):
    quiet = "import logging; logging.getLogger('carom').setLevel(logging.ERROR)\n"
    talkative = "import logging; logging.basicConfig(level=logging.INFO)\n"
    main = program.main
    program.main = quiet + main
    program.run()
    assert program.stderr == ""
    clear_folder(program)
    program.main = talkative + main
    program.run()
    assert program.stderr.count("INFO:carom:compiling total (") == 2
    assert program.stderr.count("WARNING:carom:") == 1


def clear_folder(program):
    for path in program.files():
        path.unlink()


def test_a_listener_replaces_the_output(monkeypatch, tmp_path, caplog):
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compilation.log, "announced", False)
    monkeypatch.setattr(compilation.log, "listeners", [lambda name: None])

    @kernel
    def quietly(x):
        return x + 17.0

    with caplog.at_level(logging.DEBUG, "carom"):
        quietly(1.0)
    assert [r.levelname for r in caplog.records if r.name == "carom"] == ["INFO"]


def test_the_garbage_collector_is_as_it_was_after_compiling_and_after_failing(monkeypatch, tmp_path):
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path))

    @kernel
    def five_more(x):
        return x + 5.0

    five_more(1.0)
    assert gc.isenabled()
    with pytest.raises(TypingError):
        five_more("text")
    assert gc.isenabled()
    gc.disable()
    try:
        five_more(1)
        assert not gc.isenabled()
    finally:
        gc.enable()


# -- the hash --------------------------------------------------------------------------------------------------------


def summing(helper, shift=0.0, options=part):
    @options
    def total(x):
        return helper(x) + shift

    return total


def plus(n):
    def add(x):
        return x + n

    return add


def test_the_hash_follows_calls_constants_captured_values_and_options():
    @part
    def one(x):
        return x + 1.0

    @part
    def two(x):
        return x + 2.0

    different = [
        summing(one),
        summing(two),
        summing(one, 1.0),
        summing(one, 1),
        summing(one, options=inlined),
        summing(summing(one)),
        summing(part(plus(1.0))),
        summing(part(plus(2.0))),
        summing(part(plus((1.0, 2.0)))),
        summing(part(plus(np.array([1.0, 2.0])))),
        summing(part(plus(np.array([1.0, 3.0])))),
    ]
    hashes = [deep_hash(function) for function in different]
    assert len(set(hashes)) == len(hashes)
    assert deep_hash(summing(one)) == hashes[0]


def test_functions_that_call_each_other_have_a_hash():
    def even(n):
        return n == 0 or odd(n - 1)

    def odd(n):
        return n != 0 and even(n - 1)

    assert deep_hash(even) != deep_hash(odd)


def test_the_log_counts_and_tells_listeners(monkeypatch, tmp_path):
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path))
    told = []
    compilation.log.listeners.append(told.append)
    before = len(compilation.log.compiled)
    try:

        @kernel
        def thrice(x):
            return 3.0 * x

        assert thrice(2.0) == 6.0
        assert thrice(3.0) == 9.0
    finally:
        compilation.log.listeners.remove(told.append)
    assert len(told) == 1
    assert "thrice" in told[0]
    assert len(compilation.log.compiled) == before + 1
    assert compilation.log.seconds > 0
    thrice.made._cache.flush()
    assert not list(tmp_path.glob("*.kernel"))
