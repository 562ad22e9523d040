"""Work-precision charts: positions of the drawn marks, read from matplotlib."""

from __future__ import annotations

from xml.etree import ElementTree

import helpers_trade as made
import pytest

from carom.lab.cli.usage_errors import Problem
from carom.lab.trading.charts import TIME, WORK, draw, figure, quantities, styles
from carom.lab.trading.records import Cell, Curve, ErrorBar, Point


def lines(chart, label):
    """(x, y) of all lines of that kind, or of the curve of that name."""
    return [
        (float(x), float(y))
        for line in chart.axes[0].get_lines()
        if line.get_label() == f"_{label}"
        for x, y in zip(*line.get_data(), strict=True)
    ]


def legend(chart):
    return [text.get_text() for text in chart.legends[0].get_texts()]


def test_a_curve_is_error_to_the_right_and_cost_upwards():
    chart = figure(made.smooth())
    assert (chart.axes[0].get_xscale(), chart.axes[0].get_yscale()) == ("log", "log")
    # velocity Verlet: error 0.1 (15 dt)^2, work 60,000 a step
    expected = [(0.1 * (15 * dt) ** 2, 60_000 / dt) for dt in made.STEPS]
    for seen, meant in zip(lines(chart, "velocity verlet"), expected, strict=True):
        assert seen == pytest.approx(meant)
    assert lines(figure(made.smooth(), TIME), "rk4")[0][1] == pytest.approx(1.1 * 90_000 * 15 * 1e-6)
    assert quantities(made.smooth(timed=False)) == [WORK]


def test_orders_stand_in_the_legend():
    assert legend(figure(made.smooth()))[2:] == [
        "velocity verlet, order 2.00 (2)",
        "rk4, order 4.00 (4)",
        "yoshida4, order 4.00 (4)",
        "pymunk, 10 iterations, order 1.00 (1)",
    ]
    assert legend(figure(made.bouncing()))[0] == "velocity verlet, event driven, exact"


def test_repeats_have_bars_from_the_least_to_the_largest():
    ends = [
        (segment[0][0], segment[1][0])
        for collection in figure(made.smooth(against=False)).axes[0].collections
        for segment in collection.get_segments()
    ]
    assert len(ends) == 5 * len(made.STEPS) - 1  # all 64 repeats failed at one point
    assert all(high == pytest.approx(4 * low) for low, high in ends)


def test_untrusted_points_are_hollow_and_explained():
    chart = figure(made.smooth())
    hollow = [line for line in chart.axes[0].get_lines() if line.get_label() == "_untrusted"]
    assert len(hollow) == 2
    assert all(line.get_markerfacecolor() != line.get_color() for line in hollow)
    assert "Hollow" in chart.legends[0].get_title().get_text()
    assert "Hollow" not in figure(made.smooth(), norm="energy").legends[0].get_title().get_text()


def test_an_error_of_nothing_is_drawn_left_of_all_others():
    least = min(point.errors["energy_square"].mean for point in made.bouncing().curves[1].points)
    found = lines(figure(made.bouncing()), "velocity verlet, event driven")
    assert [x for x, _ in found] == pytest.approx([least / 10] * 3)


def test_failures_are_crosses_at_their_cost():
    chart = figure(made.smooth())
    assert sorted(y for _, y in lines(chart, "failed")) == pytest.approx([60_000 * 15] * 2 + [60_000 * 30])
    assert "failed (tunnelled, escaped)" in chart.legends[0].get_title().get_text()


def test_many_curves_are_told_apart():
    looks = [(style["color"], style["marker"], style["ls"]) for style in styles(made.crowded().curves)]
    assert len(set(looks)) == len(looks) == 30
    assert styles(made.smooth().curves)[-1]["ls"] == "--"  # pymunk


def test_draws_png_and_svg_for_each_measured_case_of_whatever_name(tmp_path):
    case = made.bouncing()
    case.scene = "games/my scene.py"
    paths = draw(made.trade(made.refused(), case, case), tmp_path / "charts")
    name = "trade-games-my-scene-py-energy_square"
    assert [path.relative_to(tmp_path).as_posix() for path in paths[:4]] == [
        f"charts/{name}-{quantity}.{kind}" for quantity in (WORK, TIME) for kind in ("png", "svg")
    ]
    assert len(set(paths)) == 8
    assert paths[0].read_bytes().startswith(b"\x89PNG")
    assert ElementTree.fromstring(paths[1].read_text(encoding="utf-8")).tag.endswith("svg")
    (tmp_path / "file").write_text("")
    with pytest.raises(Problem, match="file"):
        draw(made.trade(made.bouncing()), tmp_path / "file")


def test_cases_with_hardly_anything_to_draw_are_drawn():
    """No curve, one point, errors of 0 alone, errors that are no numbers, failures alone, costs that are not known."""
    none, one, zero, odd, costless = (made.bouncing() for _ in range(5))
    none.curves = []
    one.curves = [Curve("one", [Point(Cell(0.1), 1, {one.norm: ErrorBar.of([1.0])}, {}, {}, 5.0)])]
    assert lines(figure(one), "one") == [(1.0, 5.0)]
    zero.curves = zero.curves[:1]
    for place, value in enumerate((float("nan"), float("inf"))):
        odd.curves[1].points[place].errors["energy_square"] = ErrorBar(value, value, value, 0.0)
    costless.curves[2].points[0].work = 0.0
    failed = made.smooth(against=False)
    for point in failed.points:
        point.errors, point.failures = {}, {"blew up": point.repeats}
    assert len(lines(figure(failed), "failed")) == 5 * len(made.STEPS)
    for case in (none, one, zero, odd, costless, failed):
        figure(case).canvas.draw()
