"""The limits study: every axis finds the known limits, and the command shows them."""

from __future__ import annotations

import json
import math

import click
import pytest
from click.testing import CliRunner

from carom.lab.cli.group import Commands
from carom.lab.studies.limits import report as limits_report
from carom.lab.studies.limits.command import NAMES, limits_command
from carom.lab.studies.limits.records import BREAKS, DOWN, UP, Axis, AxisLimits, BrokenError, Limits, Line, Method
from carom.lab.studies.limits.sweep import AXES, limits, measured, sweep

pytestmark = pytest.mark.slow  # many runs: half a minute or more together

PLAIN = Method("plain", ("discrete",))


@click.group(cls=Commands)
def carom():
    """The command as a subcommand of ``carom``."""


carom.add_command(limits_command)


def invoke(*arguments):
    return CliRunner().invoke(carom, ["limits", *arguments])


def axis_of(name: str) -> Axis:
    return next(axis for axis in AXES if axis.name == name)


def line_of(name: str, method: str, values=None) -> Line:
    axis = axis_of(name)
    return sweep(axis, next(m for m in axis.methods if m.name == method), values or axis.chosen(True, False))


def artificial(measure, values=(1.0, 10.0, 100.0, 1000.0), home=1.0, **more) -> Axis:
    return Axis("made", "made up", "m", "nothing", values, home, (PLAIN,), measure, **more)


# -- the sweep itself ----------------------------------------------------------------------------


def test_edges_are_bisected_to_the_axis_precision():
    """error = value / 1000: 1 % at 10, 10 % at 100; broken beyond 300. Samples of the path come first."""

    def measure(method, value):
        if value > 300:
            raise BrokenError("too much")
        return value / 1000.1

    line = sweep(artificial(measure, fine=1.02), PLAIN, (1.0, 20.0, 200.0, 1000.0))
    for level, place in (("1 %", 10.001), ("10 %", 100.01), (BREAKS, 300.0)):
        edge = line.edge(level)
        assert edge.last <= place <= edge.value <= 1.02 * edge.last
    assert line.edge(BREAKS).why == "too much"
    assert [sample.value for sample in line.samples] == sorted(sample.value for sample in line.samples)
    assert {edge.way for edge in line.edges} == {UP}


def test_both_ways_from_the_middle():
    def measure(method, value):
        return max(value / 1e4, 2e-4 / value)

    line = sweep(artificial(measure, (1e-3, 1e-2, 1.0, 100.0, 1e3), home=1.0), PLAIN, (1e-3, 1e-2, 1.0, 100.0, 1e3))
    assert 100 <= line.edge("1 %").value <= 110
    assert line.edge("10 %").value is None
    assert line.edge("10 %").last == 1e3
    assert 2e-2 / 1.1 <= line.edge("1 %", DOWN).value <= 2e-2
    assert 2e-3 / 1.1 <= line.edge("10 %", DOWN).value <= 2e-3


def test_beyond_from_the_start_and_nothing_tried_after_nothing_to_tell():
    tried = []

    def measure(method, value):
        tried.append(value)
        if value >= 10:
            raise ValueError("no such world")
        return 0.5

    line = sweep(artificial(measure, fine=None), PLAIN, (1.0, 10.0, 100.0, 1000.0))
    assert tried == [1.0, 10.0]
    assert (line.edge("10 %").value, line.edge("10 %").last) == (1.0, None)
    assert line.edge(BREAKS).why == "refused: no such world"


def test_whole_numbers_are_bisected_to_neighbours():
    line = sweep(artificial(lambda m, v: 0.0 if v < 7 else 0.2, (1.0, 20.0), whole=True), PLAIN, (1.0, 20.0))
    assert (line.edge("10 %").last, line.edge("10 %").value) == (6.0, 7.0)
    assert all(sample.value == round(sample.value) for sample in line.samples)


@pytest.mark.parametrize(("error", "why"), [(math.nan, "not finite"), (math.inf, "not finite"), (1e7, "blows up")])
def test_errors_that_are_none_count_as_broken(error, why):
    sample = measured(artificial(lambda m, v: error), PLAIN, 1.0)
    assert (sample.error, sample.broken) == (None, why)


def test_mistakes_in_a_measurement_are_not_hidden():
    def measure(method, value):
        raise TypeError("a mistake")

    with pytest.raises(TypeError, match="a mistake"):
        measured(artificial(measure), PLAIN, 1.0)


# -- known limits --------------------------------------------------------------------------------


def test_discrete_tunnels_at_its_own_size_and_the_others_never():
    """v dt = w + 2 r; beyond it the share 1 - 1 / ratio of the shots passes, to one in 200 (C5)."""
    line = line_of("speed", "discrete", (0.01, 0.9, 2.0, 10.0))
    assert line.edge(BREAKS).last <= 1.005
    assert 1.0 <= line.edge(BREAKS).value <= 1.02
    assert line.edge(BREAKS).why == "tunnels"
    assert 1 / 0.9 * 0.99 <= line.edge("10 %").value <= 1 / 0.9 * 1.02
    for sample in line.samples:
        expected = max(0.0, 1 - 1 / sample.value)
        assert sample.error == pytest.approx(expected, abs=0.0051)
    for method in ("continuous", "event_driven", "discrete with ccd"):
        line = line_of("speed", method)
        assert line.edge(BREAKS).value is None
        assert max(sample.error for sample in line.samples) < 1e-12


@pytest.mark.parametrize(
    ("method", "limit"),
    [("semi_implicit_euler", 2), ("velocity_verlet", 2), ("rk4", 8**0.5), ("yoshida4", 1.5734), ("event_driven", 2)],
)
def test_springs_break_at_their_limits(method, limit):
    """B6, from below within a hundredth: above it energy grows a millionfold in the thousand steps."""
    edge = line_of("stiffness", method, (0.99 * limit, 1.1 * limit)).edge(BREAKS)
    assert 0.99 * limit <= edge.last < edge.value <= 1.02 * limit
    assert edge.last <= limit * 1.01


def test_the_energy_of_springs_leaves_its_band_where_the_closed_forms_say():
    """B2. Semi-implicit Euler from (1, 0): E / E0 between 1 / (1 + z/2) and 1 / (1 - z/2); velocity Verlet down to
    1 - z^2 / 4; explicit Euler (1 + z^2)^1000; Runge-Kutta 4 1 - (1 - z^6/72)^1000."""
    lines = {}
    for method, level, place in (
        ("semi_implicit_euler", "1 %", 0.0198), ("velocity_verlet", "1 %", 0.2), ("velocity_verlet", "10 %", 0.4**0.5),
        ("rk4", "1 %", (72 * 1.005e-5) ** (1 / 6)), ("explicit_euler", BREAKS, math.sqrt(1e6 ** (1 / 1000) - 1)),
    ):  # fmt: skip
        if method not in lines:
            lines[method] = line_of("stiffness", method, (0.01, 0.1, 0.5, 1.0))
        edge = lines[method].edge(level)
        assert edge.last * 0.99 <= place <= edge.value * 1.01, (method, level)


@pytest.mark.parametrize(("method", "limit"), [("semi_implicit_euler", 2.0), ("velocity_verlet", 2.0), ("rk4", 2.7853)])
def test_drag_breaks_at_its_limit(method, limit):
    """B6, B7."""
    edge = line_of("drag", method, (0.95 * limit, 1.1 * limit)).edge(BREAKS)
    assert limit * 0.999 <= edge.value <= 1.02 * limit


def test_jumps():
    """B1: both Euler methods are off by g dt t / 2; at the end of a second, of 1.25 m: 1 % at 1/400 s. Others never."""
    for method in ("explicit_euler", "semi_implicit_euler"):
        edge = line_of("dt", method).edge("1 %")
        assert edge.last <= 1 / 400 * 1.01
        assert edge.value >= 1 / 400 * 0.99
    for method in ("velocity_verlet", "rk4", "yoshida4", "event_driven"):
        line = line_of("dt", method)
        assert max(sample.error for sample in line.samples) < 1e-12
        assert line.edge(BREAKS, DOWN).last == 1e-9


def test_the_step_of_a_spring_breaks_at_its_limit():
    """One oscillation a second: dt = 2 / (2 pi) s; fine down to a nanosecond."""
    line = line_of("dt-spring", "velocity_verlet")
    assert 1 / math.pi / 1.1 <= line.edge(BREAKS).value <= 1.15 / math.pi
    assert line.edge("1 %", DOWN).value is None


@pytest.mark.parametrize("method", ["discrete", "continuous", "event_driven"])
def test_far_away_nothing_moves(method):
    """C6: 1/60 m per step is less than half the spacing of the numbers beyond 2^48 m. Exact to 1e9."""
    line = line_of("distance", method)
    edge = line.edge(BREAKS)
    assert edge.last <= 2.0**48 <= edge.value <= 1.2 * 2.0**48
    assert "nothing moves" in edge.why
    for sample in line.samples:
        if sample.value <= 1e9:
            assert sample.error < 1e-6


@pytest.mark.parametrize("method", ["discrete", "continuous", "event_driven"])
def test_ratios_of_sizes_and_masses(method):
    """C4 and B9: at 1e18 to a millionth of the way (the coordinates' own precision); masses to rounding at 1e18."""
    for sample in line_of("size", method, (1.0, 1e6, 1e18)).samples:
        assert sample.error < 1e-6
    for sample in line_of("mass", method).samples:
        assert sample.error < 4 * 2.3e-16


def test_loads():
    """B19: on one box and on three any ratio of masses stands, with less than 1 % of overlap."""
    for name in ("load", "load-on-three"):
        assert max(sample.error for sample in line_of(name, "discrete", (1.0, 100.0, 1e12)).samples) < 0.01


def test_towers_sink():
    """The sum of the overlaps under n (n + 1) / 2 loads at 7.1e-5 of a box each: 1 % at 12 boxes
    (docs/limitations.md)."""
    edge = line_of("stack", "discrete", (5.0, 20.0)).edge("1 %")
    assert 10 <= edge.last < edge.value <= 13


def test_crowds_are_refused_and_two_part():
    """C1, C3: two separate; 5,000 at one point are refused, and the error states the number of pairs."""
    line = line_of("crowd", "discrete", (2.0, 5000.0))
    assert line.samples[0].error < 0.01
    assert "candidate pairs exceed the limit" in line.edge(BREAKS).why


def test_long_runs():
    """B2, B12: no drift in a thousand steps up to the effect of the window; event-driven bounces to rounding."""
    for method in ("semi_implicit_euler", "rk4"):
        assert line_of("duration", method).samples[0].error < 1e-3
    assert line_of("bounces", "event_driven").samples[0].error < 1e-12


# -- results -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def result() -> Limits:
    return limits(["mass", "speed"], ["discrete", "continuous"], quick=True)


def test_results_go_through_json(result):
    assert Limits.from_dict(json.loads(json.dumps(result.as_dict(), allow_nan=False))) == result
    assert [axis.name for axis in result.axes] == ["speed", "mass"]
    assert [line.method for line in result.axis("speed").lines] == ["discrete", "continuous", "discrete with ccd"]
    with pytest.raises(KeyError, match="no axis 'size' in this sweep"):
        result.axis("size")
    with pytest.raises(KeyError, match="no method 'rk4'"):
        result.axis("mass").line("rk4")


def test_tables_put_the_like_together(result):
    speed, mass = limits_report.tables(result)
    assert [row[0] for row in speed.rows] == ["discrete", "continuous, discrete with ccd"]
    assert speed.rows[0][-1] == "tunnels"
    assert [row[0] for row in mass.rows] == ["discrete, continuous"]
    assert mass.rows[0][1:5] == ("not up to 1e18", "not up to 1e18", "not up to 1e18", "rounding")
    assert "downwards" not in mass.headings
    assert limits_report.number(1.23456e15) == "1.23e15"
    assert limits_report.number(2.5e-9) == "2.5e-9"
    assert [limits_report.number(v) for v in (12.0, 0.0123, 2051.0, 36543.0)] == ["12", "0.0123", "2,050", "36,500"]


def test_a_table_tells_what_lies_below():
    edges = [*line_of("dt", "rk4").edges]
    table = limits_report.table(AxisLimits("dt", "step", "s", "height", [Line("rk4", [], edges)]))
    assert table.rows[0][table.headings.index("downwards")] == "fine to 1e-9"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"axes": ["sped"]}, "no axis 'sped'; did you mean 'speed'"),
        ({"modes": ["swept"]}, "no kind of collision 'swept'"),
        ({"quick": True, "long": True}, "exclude each other"),
    ],
)
def test_names_that_are_none(arguments, message):
    with pytest.raises(ValueError, match=message):
        limits(**arguments)


def test_values_of_a_sweep():
    for axis in AXES:
        quick, plain, long = axis.chosen(True, False), axis.chosen(False, False), axis.chosen(False, True)
        assert set(plain) <= set(long)
        assert list(long) == sorted(long)
        assert len(quick) <= len(plain)
    assert axis_of("duration").chosen(False, True)[-1] == 1e6


# -- the command ---------------------------------------------------------------------------------


def test_the_command_prints_draws_and_fills_a_page(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Page\n\n<!-- studies limits -->\n<!-- end of studies limits -->\nafter\n")
    result = invoke("--quick", "--axes", "mass,speed", "--into", str(page), "--out", str(tmp_path / "pictures"))
    assert result.exit_code == 0, result.output
    assert "tunnels" in result.stdout
    assert (tmp_path / "pictures" / "limits.png").read_bytes().startswith(b"\x89PNG")
    text = page.read_text()
    assert "| method | 1 % at | 10 % at | breaks at | worst | how |" in text
    assert text.endswith("<!-- end of studies limits -->\nafter\n")


def test_the_command_prints_json():
    result = invoke("--quick", "--axes", "mass", "--json")
    assert result.exit_code == 0, result.output
    assert Limits.from_dict(json.loads(result.stdout)).axes[0].name == "mass"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--axes", "sped"], "--axes: no 'sped'; did you mean 'speed'?"),
        (["--axes", ","], "--axes takes names"),
        (["--quick", "--long"], "--quick and --long exclude each other"),
        (["--json", "--markdown"], "--json and --markdown exclude each other"),
        (["--seed", "1"], "--seed needs --pairs"),
        (["--into", "nowhere.md"], "--into nowhere.md"),
    ],
)
def test_the_command_refuses_in_one_line(arguments, message):
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert message in result.output
    assert len(result.output.strip().splitlines()) == 1


def test_every_axis_is_named_in_the_help():
    text = " ".join(invoke("--help").output.split())
    for name in NAMES:
        assert name in text
