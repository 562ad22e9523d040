"""The limits study: every quantity finds the limits that are known, and where the search looks."""

from __future__ import annotations

import pytest

from studies.limits.edges import BREAKS, DOWN, BrokenError, Method, Quantity, axis_of, edge
from studies.limits.tables import QUANTITIES, axes, number, report, table
from studies.runner import Line, run

pytestmark = [pytest.mark.slow, pytest.mark.early]  # many runs: half a minute or more together

PLAIN = Method("plain")
BY_NAME = {quantity.name: quantity for quantity in QUANTITIES}


class Found:
    """The samples of a quantity by one method, and their edges."""

    def __init__(self, quantity, method, values):
        self.quantity, self.line = quantity, run([axis_of(quantity, method, values)]).lines[0]
        self.errors = {sample.value: sample.facts["error"] for sample in self.line.samples}

    def edge(self, level, *way):
        return edge(self.quantity, self.line.samples, level, *way)


def found(name: str, method: str, values=None) -> Found:
    quantity = BY_NAME[name]
    (of,) = (of for of in quantity.methods if of.name == method)
    return Found(quantity, of, values or quantity.chosen(True, False))


def made_up(measure, values=(1.0, 10.0, 100.0, 1000.0), **more) -> Found:
    return Found(Quantity("made", "made up", "m", "nothing", values, 1.0, (PLAIN,), measure, **more), PLAIN, values)


# -- the search itself ---------------------------------------------------------------------------


def test_edges_are_bisected_to_the_precision_of_the_quantity():
    """error = value / 1000: 1 % at 10, 10 % at 100; broken beyond 300."""

    def measure(method, value):
        if value > 300:
            raise BrokenError("too much")
        return value / 1000.1

    of = made_up(measure, (1.0, 20.0, 200.0, 1000.0), fine=1.02)
    for level, place in (("1 %", 10.001), ("10 %", 100.01), (BREAKS, 300.0)):
        assert of.edge(level).last <= place <= of.edge(level).value <= 1.02 * of.edge(level).last
    assert of.edge(BREAKS).why == "too much"


def test_both_ways_from_the_middle():
    of = made_up(lambda method, value: max(value / 1e4, 2e-4 / value), (1e-3, 1e-2, 1.0, 100.0, 1e3))
    assert 100 <= of.edge("1 %").value <= 110
    assert (of.edge("10 %").value, of.edge("10 %").last) == (None, 1e3)
    assert 2e-2 / 1.1 <= of.edge("1 %", DOWN).value <= 2e-2
    assert 2e-3 / 1.1 <= of.edge("10 %", DOWN).value <= 2e-3


def test_beyond_from_the_start_and_nothing_tried_after_a_refusal():
    def measure(method, value):
        if value >= 10:
            raise ValueError("no such world")
        return 0.5

    of = made_up(measure, fine=None)
    assert list(of.errors) == [1.0, 10.0]
    assert (of.edge("10 %").value, of.edge("10 %").last) == (1.0, None)
    assert of.edge(BREAKS).why == "refused: no such world"


def test_whole_numbers_are_bisected_to_neighbours():
    of = made_up(lambda method, value: 0.0 if value < 7 else 0.2, (1.0, 20.0), whole=True)
    assert (of.edge("10 %").last, of.edge("10 %").value) == (6.0, 7.0)
    assert all(value == round(value) for value in of.errors)


def test_mistakes_in_a_measurement_are_not_hidden():
    def measure(method, value):
        raise TypeError("a mistake")

    with pytest.raises(TypeError, match="a mistake"):
        made_up(measure)


# -- known limits --------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "method", "values", "level", "limit"), [
    ("speed", "discrete", (0.01, 0.9, 2.0, 10.0), BREAKS, 1.0),  # v dt = w + 2 r
    ("stiffness", "velocity_verlet", (1.98, 2.2), BREAKS, 2.0),
    ("stiffness", "semi_implicit_euler", (0.01, 0.1, 0.5, 1.0), "1 %", 0.0198),  # E / E0 up to 1 / (1 - z/2)
    ("drag", "rk4", (2.757, 3.064), BREAKS, 2.7853),
    ("dt", "semi_implicit_euler", None, "1 %", 1 / 400),  # off by g dt t / 2, after a second, of 1.25 m
    ("distance", "continuous", None, BREAKS, 2.0**48),  # beyond it 1/60 m is less than half the spacing of the numbers
])  # fmt: skip
def test_limits_that_are_known(name, method, values, level, limit):
    of = found(name, method, values).edge(level)
    assert 0.99 * of.last <= limit <= 1.01 * of.value <= 1.22 * limit


@pytest.mark.parametrize(("name", "method", "values", "most"), [
    ("speed", "event_driven", None, 1e-12), ("dt", "rk4", None, 1e-12), ("mass", "continuous", None, 1e-15),
    ("size", "discrete", (1.0, 1e6, 1e18), 1e-6),  # to the coordinates' own precision
])  # fmt: skip
def test_what_has_no_limit(name, method, values, most):
    assert max(found(name, method, values).errors.values()) < most


def test_loads_towers_and_crowds():
    """On one box and on three any ratio of masses stands, with less than 1 % of overlap. A tower's sum of overlaps
    under n (n + 1) / 2 loads at 7.1e-5 of a box each is 1 % at 12 boxes. Two bodies at one point separate, 5,000 are
    refused."""
    for name in ("load", "load-on-three"):
        assert max(found(name, "discrete", (1.0, 100.0, 1e12)).errors.values()) < 0.01
    of = found("stack", "discrete", (5.0, 20.0)).edge("1 %")
    assert 10 <= of.last < of.value <= 13
    of = found("crowd", "discrete", (2.0, 5000.0))
    assert of.errors[2.0] < 0.01
    assert "candidate pairs exceed the limit" in of.edge(BREAKS).why


# -- the report ----------------------------------------------------------------------------------


def test_tables_put_the_like_together():
    quick = [axis for axis in axes(quick=True) if axis.name in ("speed", "mass")]
    (speed, mass), _ = report(run(quick))
    assert [row[0] for row in speed.rows] == ["discrete", "continuous, event_driven, discrete with ccd"]
    assert speed.rows[0][-1] == "tunnels"
    assert [row[0] for row in mass.rows] == ["discrete, continuous, event_driven"]
    assert mass.rows[0][1:5] == ("not up to 1e18", "not up to 1e18", "not up to 1e18", "rounding")
    assert "downwards" not in mass.headings
    of = found("dt", "rk4")
    below = table(of.quantity, [Line("dt", "rk4", of.line.samples)])
    assert below.rows[0][below.headings.index("downwards")] == "fine to 1e-9"
    assert [number(value) for value in (1.23456e15, 2.5e-9, 12.0, 0.0123, 2051.0, 36543.0)] == [
        "1.23e15", "2.5e-9", "12", "0.0123", "2,050", "36,500",
    ]  # fmt: skip
