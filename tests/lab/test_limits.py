"""The limits study: every quantity finds the limits that are known, and where the search looks."""

from __future__ import annotations

import math

import pytest

from studies.limits import axes
from studies.limits.edges import BREAKS, DOWN, BrokenError, Method, Quantity, axis_of, edge
from studies.limits.tables import QUANTITIES, number, report, table
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


def test_discrete_tunnels_at_its_own_size_and_the_others_never():
    """v dt = w + 2 r; beyond it the share 1 - 1 / ratio of the shots passes, to one in 200."""
    of = found("speed", "discrete", (0.01, 0.9, 2.0, 10.0))
    assert of.edge(BREAKS).last <= 1.005
    assert 1.0 <= of.edge(BREAKS).value <= 1.02
    assert of.edge(BREAKS).why == "tunnels"
    for value, error in of.errors.items():
        assert error == pytest.approx(max(0.0, 1 - 1 / value), abs=0.0051)
    for method in ("continuous", "event_driven", "discrete with ccd"):
        of = found("speed", method)
        assert of.edge(BREAKS).value is None
        assert max(of.errors.values()) < 1e-12


@pytest.mark.parametrize(
    ("name", "method", "limit"),
    [
        ("stiffness", "semi_implicit_euler", 2), ("stiffness", "velocity_verlet", 2), ("stiffness", "rk4", 8**0.5),
        ("stiffness", "yoshida4", 1.5734), ("stiffness", "event_driven", 2),
        ("drag", "semi_implicit_euler", 2), ("drag", "velocity_verlet", 2), ("drag", "rk4", 2.7853),
    ],
)  # fmt: skip
def test_springs_and_drag_break_at_their_limits(name, method, limit):
    of = found(name, method, (0.99 * limit, 1.1 * limit)).edge(BREAKS)
    assert 0.99 * limit <= of.last < of.value <= 1.02 * limit
    assert of.value >= 0.999 * limit


def test_the_energy_of_springs_leaves_its_band_where_the_closed_forms_say():
    """Semi-implicit Euler from (1, 0): E / E0 between 1 / (1 + z/2) and 1 / (1 - z/2); velocity Verlet down to
    1 - z^2 / 4; explicit Euler (1 + z^2)^1000; Runge-Kutta 4 1 - (1 - z^6/72)^1000."""
    lines = {}
    for method, level, place in (
        ("semi_implicit_euler", "1 %", 0.0198), ("velocity_verlet", "1 %", 0.2), ("velocity_verlet", "10 %", 0.4**0.5),
        ("rk4", "1 %", (72 * 1.005e-5) ** (1 / 6)), ("explicit_euler", BREAKS, math.sqrt(1e6 ** (1 / 1000) - 1)),
    ):  # fmt: skip
        if method not in lines:
            lines[method] = found("stiffness", method, (0.01, 0.1, 0.5, 1.0))
        of = lines[method].edge(level)
        assert of.last * 0.99 <= place <= of.value * 1.01, (method, level)


def test_jumps():
    """Both Euler methods are off by g dt t / 2; at the end of a second, of 1.25 m: 1 % at 1/400 s. Others never."""
    for method in ("explicit_euler", "semi_implicit_euler"):
        of = found("dt", method).edge("1 %")
        assert of.last * 0.99 <= 1 / 400 <= of.value * 1.01
    for method in ("velocity_verlet", "rk4", "yoshida4", "event_driven"):
        of = found("dt", method)
        assert max(of.errors.values()) < 1e-12
        assert of.edge(BREAKS, DOWN).last == 1e-9


@pytest.mark.parametrize("method", ["discrete", "continuous", "event_driven"])
def test_far_away_nothing_moves_and_ratios_do_not_matter(method):
    """1/60 m per step is less than half the spacing of the numbers beyond 2^48 m. Exact to 1e9; sizes at 1e18 to a
    millionth of the way (the coordinates' own precision); masses to rounding at 1e18."""
    of = found("distance", method)
    assert of.edge(BREAKS).last <= 2.0**48 <= of.edge(BREAKS).value <= 1.2 * 2.0**48
    assert "nothing moves" in of.edge(BREAKS).why
    assert max(error for value, error in of.errors.items() if value <= 1e9) < 1e-6
    assert max(found("size", method, (1.0, 1e6, 1e18)).errors.values()) < 1e-6
    assert max(found("mass", method).errors.values()) < 4 * 2.3e-16


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
