"""The limits study: it finds the limits that are known, and narrows down where the error passes a level."""

from __future__ import annotations

import pytest

from studies.limits.search import BREAKS, axes, edge, number, outcome, report, search
from studies.limits.worlds import QUANTITIES, BrokenError, Quantity
from studies.runner import run

pytestmark = [pytest.mark.slow, pytest.mark.early]  # many runs: half a minute or more together

BY_NAME = {quantity.name: quantity for quantity in QUANTITIES}


def found(name, method, values=None):
    return search(BY_NAME[name], values or BY_NAME[name].quick, method)


def made_up(measure, values, **more):
    return search(Quantity("made", "made up", "m", "nothing", values, {"plain": {}}, measure, **more), values, "plain")


# -- the search itself ---------------------------------------------------------------------------


def test_edges_are_bisected_to_the_precision_of_the_quantity():
    """error = value / 1000: 1 % at 10, 10 % at 100; broken beyond 300, and nothing is tried after that."""

    def measure(method, value):
        if value > 300:
            raise BrokenError("too much")
        return value / 1000.1

    of = made_up(measure, (1.0, 20.0, 200.0, 1000.0, 1e4), fine=1.02)
    assert max(of) == 1000.0
    for level, place in (("1 %", 10.001), ("10 %", 100.01), (BREAKS, 300.0)):
        good, bad = edge(of, level)
        assert good <= place <= bad <= 1.02 * good
    assert of[edge(of, BREAKS)[1]] == (None, "too much")
    assert edge({1.0: (0.5, "")}, "10 %") == (None, 1.0)
    assert edge({1.0: (0.05, "")}, "10 %") == (1.0, None)


def test_whole_numbers_are_bisected_to_neighbours():
    of = made_up(lambda method, value: 0.0 if value < 7 else 0.2, (1.0, 20.0), whole=True)
    assert edge(of, "10 %") == (6.0, 7.0)
    assert all(value == round(value) for value in of)


def test_errors_of_carom_break_and_mistakes_are_not_hidden():
    def raises(error):
        def measure(method, value):
            raise error

        return outcome(Quantity("made", "", "", "", (), {}, measure), {}, 1.0)

    assert raises(ValueError("no such world")) == (None, "refused: no such world")
    with pytest.raises(TypeError, match="a mistake"):
        raises(TypeError("a mistake"))


# -- known limits --------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "method", "values", "level", "limit"), [
    ("speed", "discrete", (0.01, 0.9, 2.0, 10.0), BREAKS, 1.0),  # v dt = w + 2 r
    ("stiffness", "velocity_verlet", (1.98, 2.04), BREAKS, 2.0),
    ("stiffness", "semi_implicit_euler", (0.019, 0.0205), "1 %", 0.0198),  # E / E0 up to 1 / (1 - z/2)
    ("stiffness", "rk4", (2.8, 2.86), BREAKS, 8**0.5),
    ("dt", "velocity_verlet", (0.008, 0.012), "1 %", 0.00984),  # its phase is off by z^2 / 24 of 20 pi, z = 2 pi dt
    ("distance", "continuous", None, BREAKS, 2.0**48),  # beyond it 1/60 m is less than half the spacing of the numbers
])  # fmt: skip
def test_limits_that_are_known(name, method, values, level, limit):
    good, bad = edge(found(name, method, values), level)
    assert 0.99 * good <= limit <= 1.01 * bad <= 1.22 * limit


@pytest.mark.parametrize(("name", "method", "values", "most"), [
    ("speed", "event_driven", None, 1e-12), ("speed", "discrete with ccd", (2.0, 100.0), 1e-12),
    ("dt", "rk4", (1e-9, 1e-4, 1e-3), 1e-9), ("load", "discrete", (1.0, 100.0, 1e12), 0.01),
])  # fmt: skip
def test_what_has_no_limit(name, method, values, most):
    assert max(error for error, _ in found(name, method, values).values()) < most


def test_a_tower_sinks_with_its_square():
    """The sum of overlaps under n (n + 1) / 2 loads at 7.1e-5 of a box each is 1 % at 12 boxes."""
    good, bad = edge(found("stack", "discrete", (5.0, 20.0)), "1 %")
    assert 10 <= good < bad <= 13


# -- the report ----------------------------------------------------------------------------------


def test_tables_put_the_like_together():
    quick = [axis for axis in axes(quick=True) if axis.name in ("distance", "speed")]
    (distance, speed), _ = report(run(quick))
    assert [row[0] for row in speed.rows] == ["discrete", "continuous, event_driven, discrete with ccd"]
    assert speed.rows[0][-1] == "tunnels"
    assert [row[0] for row in distance.rows] == ["discrete, continuous, event_driven"]
    assert speed.rows[1][1:] == (*["not up to 1e6"] * 3, "rounding", "-")
    assert [number(value) for value in (1.23456e15, 2.5e-9, 12.0, 0.0123, 2051.0, 36543.0)] == [
        "1.23e15", "2.5e-9", "12", "0.0123", "2,050", "36,500",
    ]  # fmt: skip
