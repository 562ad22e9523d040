"""sin and its friends: less than a unit in the last place from sixty digits, the same bits compiled or not."""

from __future__ import annotations

import decimal
import math
import random
import struct
import sys
from decimal import Decimal

import numpy as np
import pytest
from oracles.elementary import FUNCTIONS

from carom.framework import elementary
from carom.framework.compilation import kernel
from carom.framework.jit.lazy import JIT

TWO = "atan2", "power"
LARGEST = Decimal(sys.float_info.max)
EDGES = (
    0.0, -0.0, 5e-324, -5e-324, 2.0**-1022, 1e-300, 0.5, 1.0, -1.0, 2.0, 1.7e308, -1.7e308, 1e6, -1e6, 1e6 + 1e-9,
    709.782712893384, 709.8, 710.0, -745.1332191019411, -745.2, -38.9, -39.1, 0.25 * math.pi, 0.5 * math.pi, math.pi,
    6381956970095103 * 2.0**797,  # of all numbers the one nearest to a multiple of pi/2
    math.inf, -math.inf, math.nan,
)  # fmt: skip


def any_number(draw: random.Random) -> float:
    return struct.unpack("d", struct.pack("Q", draw.getrandbits(64)))[0]


def arguments(name: str, seed: int, count: int) -> list[tuple[float, ...]]:
    """Of usual size, of any, and at edges."""
    draw = random.Random(seed)
    spread = {"exp": 745.0, "expm1": 745.0, "power": 20.0}.get(name, 100.0)
    usual = [[draw.uniform(-spread, spread) * draw.random() ** 4 for _ in range(count)] for _ in range(2)]
    extreme = [[any_number(draw) for _ in range(count)] for _ in range(2)]
    if name == "power":
        usual[0], extreme[0] = ([abs(x) for x in numbers] for numbers in (usual[0], extreme[0]))
    if name in TWO:
        return [*zip(*usual, strict=True), *zip(*extreme, strict=True), *((x, y) for x in EDGES for y in EDGES)]
    near = [draw.randrange(10**15) * (0.5 * math.pi) for _ in range(count)]
    return [(x,) for x in (*usual[0], *extreme[0], *near, *EDGES)]


def error(found: float, true: Decimal) -> float:
    """In units in the last place."""
    if abs(true) > LARGEST or math.isinf(found):
        return 0.0 if abs(true) > LARGEST and found == math.copysign(math.inf, true) else math.inf
    return float(abs(Decimal(found) - true) / Decimal(math.ulp(found)))


@pytest.mark.slow
@pytest.mark.plain
@pytest.mark.parametrize("name", list(FUNCTIONS))
def test_less_than_a_unit_in_the_last_place(name):
    function, worst = getattr(elementary, name), 0.0
    with decimal.localcontext(prec=60):
        for given in arguments(name, 1, 400):
            usual = all(map(math.isfinite, given))
            if name == "power":
                usual &= given[0] > 0.0 and abs(given[1]) < 1e3
            if usual:
                worst = max(worst, error(function(*given), FUNCTIONS[name](*given)))
    assert 0.4 < worst < 0.9  # an error of 0.5 is that of rounding


@pytest.mark.plain
@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name != "power"])
def test_what_is_no_number_and_the_sign_of_zero(name):
    function, known = getattr(elementary, name), getattr(math, name)
    for given in (arguments(name, 1, 0) if name == "atan2" else [(x,) for x in EDGES]):
        if all(x == 0.0 or not math.isfinite(x) for x in given):
            try:
                expected = known(*given)
            except ValueError:  # what Python says of sin(inf)
                expected = math.nan
            assert np.array_equal(function(*given), expected, equal_nan=True), given
            assert math.isnan(expected) or math.copysign(1.0, function(*given)) == math.copysign(1.0, expected), given


@pytest.mark.plain
def test_powers_at_the_edges():
    power, inf = elementary.power, math.inf
    for x, y, expected in (
        (0.0, 2.0, 0.0), (0.0, -2.0, inf), (inf, 0.5, inf), (inf, -0.5, 0.0), (2.0, inf, inf), (0.5, inf, 0.0),
        (2.0, -inf, 0.0), (1.0, inf, 1.0), (0.0, 0.0, 1.0), (1e300, 2.0, inf), (1e-300, 2.0, 0.0), (27.0, 1 / 3, 3.0),
        (10.0, 3.0, 1000.0), (2.0, -1074.0, 5e-324),
    ):  # fmt: skip
        assert power(x, y) == expected, (x, y)
    assert math.isnan(power(-1.0, 2.0))
    assert math.isnan(power(2.0, math.nan))


@pytest.mark.slow
@pytest.mark.skipif(not JIT, reason="nothing compiles")
@pytest.mark.parametrize("name", list(FUNCTIONS))
def test_compiled_and_plain_have_the_same_bits(name):
    function = getattr(elementary, name)

    def of_one(x, found):
        for i in range(len(x)):
            found[i] = function(x[i])

    def of_two(x, y, found):
        for i in range(len(x)):
            found[i] = function(x[i], y[i])

    given = arguments(name, 2, 2000)
    found = np.empty(len(given))
    kernel(of_two if name in TWO else of_one)(*np.array(given).T.copy(), found)
    expected = np.array([function.plain(*each) for each in given])
    no_number = np.isnan(expected)
    assert np.isnan(found[no_number]).all()
    assert (found.view(np.int64) == expected.view(np.int64))[~no_number].all()


@pytest.mark.plain
def test_of_arrays_as_of_each_number():
    given = np.array([x for (x,) in arguments("sin", 3, 200)])
    for some in (given, given[:3], given[:0], given[:600].reshape(20, 30)):
        for found, function in zip(elementary.sines_and_cosines(some), (elementary.sin, elementary.cos), strict=True):
            expected = np.array([function(x) for x in some.ravel().tolist()])
            assert np.array_equal(found, expected.reshape(some.shape), equal_nan=True)
            assert (np.signbit(found) == np.signbit(expected.reshape(some.shape)))[~np.isnan(found)].all()
