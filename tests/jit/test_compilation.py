"""Compiling in this process: the cache folder, the log and its listeners, and the hash that names files."""

from __future__ import annotations

import gc
import math
import sys
import types

import numpy as np
import pytest
from numba.core.errors import TypingError

from carom.framework.compilation import inlined, kernel, packed, part
from carom.framework.jit import cache as kernel_cache
from carom.framework.jit import source
from carom.framework.jit.hash import deep_hash


@pytest.mark.parametrize(
    ("module", "call", "reason"),
    [("tempfile", "mkstemp", "no space left on device"), ("os", "replace", "connection to the disk lost")],
)
def test_a_disk_that_fails_costs_speed_and_not_the_run(monkeypatch, tmp_path, caplog, module, call, reason):
    """It is told once, and nothing is left behind."""
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path))

    def fails(*args, **kwargs):
        raise OSError(reason)

    monkeypatch.setattr(getattr(kernel_cache, module), call, fails)

    @kernel
    def twice(x):
        return 2.0 * x

    assert twice(4.0) == 8.0
    assert twice(4) == 8.0
    assert not list(tmp_path.iterdir())
    assert [r.getMessage() for r in caplog.records if "cannot be kept" in r.getMessage()] == [
        f"carom: kernels cannot be kept in {tmp_path}, the next run compiles again: {reason}"
    ]


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


def summing(helper, shift=0.0, options=part):
    @options
    def total(x):
        return helper(x) + shift

    return total


def in_turn(first, second, third):
    def through(x):
        return third(second(first(x)))

    return through


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
        summing(one), summing(two), summing(one, 1.0), summing(one, 1), summing(one, options=inlined),
        summing(summing(one)), summing(part(plus(1.0))), summing(part(plus(2.0))), summing(part(plus((1.0, 2.0)))),
        summing(part(plus(np.array([1.0, 2.0])))), summing(part(plus(np.array([1.0, 3.0])))),
        summing(part(plus(math.sin))), summing(part(plus(math.cos))), summing(part(plus(np.sin))),
        summing(part(plus(np.cos))), summing(part(plus(np.dot))), summing(part(plus(np.sum))),
    ]  # fmt: skip
    hashes = [deep_hash(function) for function in different]
    assert len(set(hashes)) == len(hashes)
    assert deep_hash(summing(one)) == hashes[0]
    assert deep_hash(in_turn(one, two, one)) != deep_hash(in_turn(one, two, two))


def shear(x, y, out):
    for k in range(len(out) // 2):
        out[2 * k], out[2 * k + 1] = x[2 * k] + 0.1 * y[2 * k], x[2 * k + 1] + 0.1 * y[2 * k + 1]


@pytest.mark.slow
def test_a_packed_kernel_is_another_one_with_the_same_bits(monkeypatch, tmp_path):
    """LLVM's SLP vectorizer works on both components of a vector at once, and reorders no sum."""
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path))
    plain, twin = kernel(shear), types.FunctionType(shear.__code__, globals(), "shear")
    together = kernel(packed(twin))
    assert deep_hash(plain) != deep_hash(together)
    x, y = np.random.default_rng(3).normal(size=(2, 64)) * 1e3
    one, other = np.zeros(64), np.zeros(64)
    plain(x, y, one)
    together(x, y, other)
    assert one.tobytes() == other.tobytes()
    assert one == pytest.approx(x + 0.1 * y)


def test_a_process_remembers_a_bounded_number_of_generated_modules(monkeypatch):
    monkeypatch.setattr(source, "MODULES", len(source._made) + 3)
    names = [source.source_module(f"value = {k}", {}).__name__ for k in range(5)]
    assert all(name in sys.modules for name in names[-3:])
    assert sum(name.startswith("carom_shapes_") for name in sys.modules) <= source.MODULES
