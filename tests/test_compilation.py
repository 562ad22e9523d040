"""The cache of compiled kernels: found again by other processes, never stale, never in the way."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from carom.framework import compilation
from carom.framework.compilation import deep_hash, inlined, kernel, part

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
from carom.framework.compilation import deep_hash, kernel, log
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
        self.main = MAIN.format(folder=str(folder))

    def run(self, seed="0", **environment) -> tuple[float, float, int, int, str]:
        """What both kernels return, how many were compiled and how many loaded, and the hash of the first."""
        (self.folder / "helpers.py").write_text(self.helpers)
        everything = {
            **os.environ, "CAROM_CACHE_DIR": str(self.cache), "PYTHONHASHSEED": seed, "PYTHONDONTWRITEBYTECODE": "1",
            **environment,
        }  # fmt: skip
        result = subprocess.run(
            [sys.executable, "-c", self.main], env=everything, capture_output=True, text=True, cwd=self.folder
        )
        assert result.returncode == 0, result.stderr
        first, second, compiled, loaded, digest = result.stdout.split()
        return float(first), float(second), int(compiled), int(loaded), digest

    def files(self) -> list[Path]:
        return sorted(self.cache.glob("*.kernel"))


@pytest.fixture
def program(tmp_path):
    return Program(tmp_path)


def test_a_second_process_loads_what_the_first_has_compiled(program):
    """Kernels made by a factory, closures over one another: what numba's own cache never finds again."""
    first = program.run(seed="1")
    assert first[:4] == (9.0, 109.0, 2, 0)
    assert len(program.files()) == 2
    second = program.run(seed="2")
    assert second[:4] == (9.0, 109.0, 0, 2)
    assert second[4] == first[4]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("FACTOR * x", "FACTOR * x * x", 13.0),  # two calls deep, in another file
        ("FACTOR = 2.0", "FACTOR = 3.0", 12.0),  # a constant there
        ("+ 1.0", "+ 2.0", 12.0),
    ],
)
def test_an_edit_in_a_function_of_another_file_is_noticed(program, old, new, expected):
    program.run()
    program.helpers = program.helpers.replace(old, new)
    assert program.run()[:3] == (expected, expected + 100.0, 2)
    program.helpers = HELPERS
    assert program.run()[:3] == (9.0, 109.0, 0)  # and taking it back finds the old one


def test_an_edit_of_a_comment_compiles_nothing(program):
    program.run()
    program.helpers = "# a remark\n" + program.helpers
    assert program.run()[2] == 0


@pytest.mark.parametrize("damage", [b"", b"garbage", None], ids=["empty", "garbage", "cut short"])
def test_a_damaged_file_is_compiled_anew_and_replaced(program, damage):
    program.run()
    for path in program.files():
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2] if damage is None else damage)
    assert program.run()[:4] == (9.0, 109.0, 2, 0)
    assert program.run()[2:4] == (0, 2)


def test_without_any_folder_to_write_to_everything_works_and_nothing_is_kept(program):
    blocked = program.folder / "a file"
    blocked.write_text("no folder can be made in here")
    nowhere = str(blocked / "x")
    program.cache = Path(nowhere)
    environment = {"XDG_CACHE_HOME": nowhere, "HOME": nowhere, "TMPDIR": nowhere}
    # tempfile falls back to the current folder if TMPDIR is of no use
    code = f"import tempfile; tempfile.tempdir = {nowhere!r}\n"
    program.main = code + program.main
    for _ in range(2):
        assert program.run(**environment)[:4] == (9.0, 109.0, 2, 0)
    assert not list(program.folder.rglob("*.kernel"))


def test_a_folder_that_cannot_be_written_is_passed_over(monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("CAROM_CACHE_DIR", str(blocked / "sub"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    assert compilation.cache_folder() == tmp_path / "home" / "carom"
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path / "chosen"))
    assert compilation.cache_folder() == tmp_path / "chosen"
    assert (tmp_path / "chosen").is_dir()


def test_a_disk_that_fills_up_costs_speed_and_not_the_run(monkeypatch, tmp_path):
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path))

    def full(*args, **kwargs):
        raise OSError("no space left on device")

    monkeypatch.setattr(compilation.tempfile, "mkstemp", full)

    @kernel
    def twice(x):
        return 2.0 * x

    assert twice(4.0) == 8.0
    assert not list(tmp_path.iterdir())


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
    thrice._cache.flush()
    assert not list(tmp_path.glob("*.kernel"))
