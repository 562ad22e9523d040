"""Work-precision charts: positions of the drawn marks, read from matplotlib; and that no point is left out."""

from __future__ import annotations

from xml.etree import ElementTree

import helpers_trade as made
import pytest

from carom.lab.cli.usage_errors import Problem
from carom.lab.trading.charts import FEW, TIME, WORK, draw, figure, legend_text, quantities, styles
from carom.lab.trading.records import PYMUNK, Cell, Curve, ErrorBar, Point


def plot(chart):
    return chart.axes[0]


def strip(chart):
    return chart.axes[1]


def lines(axes, label):
    """(x, y) of all lines with this label."""
    return [
        (float(x), float(y))
        for line in axes.get_lines()
        if line.get_label() == label
        for x, y in zip(*line.get_data(), strict=True)
    ]


def legend(chart):
    return [text.get_text() for text in chart.legends[0].get_texts()]


def words(chart):
    small_print = [legend.get_title().get_text() for legend in chart.legends]
    return [text.get_text() for text in chart.texts] + [chart.axes[0].get_title("left")] + small_print


# -- curves -----------------------------------------------------------------------------------------------------


def test_a_curve_is_error_to_the_right_and_work_upwards():
    case = made.smooth()
    chart = figure(case)
    assert (plot(chart).get_xscale(), plot(chart).get_yscale()) == ("log", "log")
    # velocity Verlet: error 0.1 (15 dt)^2, work 60,000 a step
    expected = [(0.1 * (15 * dt) ** 2, 60_000 / dt) for dt in made.STEPS]
    for seen, meant in zip(lines(plot(chart), "velocity verlet"), expected, strict=True):
        assert seen == pytest.approx(meant)
    assert {line.get_label() for line in plot(chart).get_lines()} >= {curve.label for curve in case.curves}


def test_everything_drawn_lies_within_the_axes():
    for quantity in (WORK, TIME):
        for case in (made.smooth(), made.bouncing(), made.crowded()):
            for axes in figure(case, quantity).axes:
                (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
                for line in axes.get_lines():
                    if line.get_transform() == axes.transData:
                        assert all(left <= x <= right for x in line.get_xdata())
                        assert all(bottom <= y <= top for y in line.get_ydata())


def test_orders_stand_in_the_legend():
    assert legend(figure(made.smooth())) == [
        "explicit euler, order 1.00 (1)",
        "semi implicit euler, order 1.00 (1)",
        "velocity verlet, order 2.00 (2)",
        "rk4, order 4.00 (4)",
        "yoshida4, order 4.00 (4)",
        "pymunk, 10 iterations, order 1.00 (1)",
    ]
    assert legend(figure(made.bouncing()))[0] == "velocity verlet, event driven, exact"
    assert legend_text(Curve("a method", [], {"energy": None}), "energy") == "a method"


def test_wall_times_where_there_are_some():
    assert quantities(made.smooth()) == [WORK, TIME]
    assert quantities(made.smooth(timed=False)) == [WORK]
    chart = figure(made.smooth(), TIME)
    assert lines(plot(chart), "rk4")[0][1] == pytest.approx(1.1 * 90_000 * 15 * 1e-6)
    assert "ms" in plot(chart).get_ylabel()


def test_repeats_have_bars_from_the_least_to_the_largest():
    ends = [
        (segment[0][0], segment[1][0])
        for collection in plot(figure(made.smooth(against=False))).collections
        for segment in collection.get_segments()
    ]
    assert len(ends) == 5 * len(made.STEPS) - 1  # all 64 repeats failed at one point
    assert all(high == pytest.approx(4 * low) for low, high in ends)


def test_untrusted_points_are_hollow_and_explained():
    chart = figure(made.smooth())
    hollow = [line for line in plot(chart).get_lines() if line.get_label() == "untrusted"]
    assert len(hollow) == 2
    assert all(line.get_markerfacecolor() != line.get_color() for line in hollow)
    assert any("Hollow" in text for text in words(chart))
    assert not any("Hollow" in text for text in words(figure(made.smooth(), norm="energy")))


def test_an_error_of_nothing_is_drawn_at_the_left_edge():
    chart = figure(made.bouncing())
    left = plot(chart).get_xlim()[0]
    assert [x for x, _ in lines(plot(chart), "zero")] == [left] * 3
    least = min(point.errors["energy_square"].mean for point in made.bouncing().curves[1].points)
    assert left < least / 9


# -- failures ---------------------------------------------------------------------------------------------------


def test_failures_are_crosses_in_a_strip_at_their_work():
    chart = figure(made.smooth())
    # kinds in the order of the records: escaped, then tunnelled
    assert lines(strip(chart), "escaped") == [(0.5, pytest.approx(60_000 * 30))]
    tunnelled = lines(strip(chart), "tunnelled")
    assert [y for _, y in tunnelled] == pytest.approx([60_000 * 15] * 2)
    assert all(1 < x < 2 for x, _ in tunnelled)
    texts = [text.get_text() for text in strip(chart).texts]
    assert {"escaped", "tunnelled", "3/64", "2/64"} <= set(texts)
    assert "64/64" not in texts
    assert strip(chart).get_title() == "failed"
    assert strip(chart).get_ylim() == plot(chart).get_ylim()


def test_no_failure_is_left_out_of_the_chart_of_wall_times():
    case = made.smooth()
    for curve in case.curves:
        for point in curve.points:
            point.milliseconds = None if point.failed else point.milliseconds
    chart = figure(case, TIME)
    top = strip(chart).get_ylim()[1]
    crosses = lines(strip(chart), "tunnelled") + lines(strip(chart), "escaped")
    assert len(crosses) == 3
    assert all(top / 2 < y < top for _, y in crosses)
    assert any("wall time of 3 that failed is not known" in text for text in words(chart))


# -- colours, lines, markers ------------------------------------------------------------------------------------


def test_many_curves_are_told_apart_by_colour_line_and_marker():
    case = made.crowded()
    for substeps in (5, 10):
        cell = Cell(1.0, "semi_implicit_euler", substeps=substeps, engine=PYMUNK)
        case.curves.append(made.curve(cell, f"pymunk {substeps}", steps=made.STEPS[:2]))
    assert len(case.curves) > FEW
    looks = styles(case.curves)
    assert len({(look.colour, look.line, look.marker) for look in looks}) == len(looks)
    cells = [curve.points[0].cell for curve in case.curves]
    for what, of in (("colour", "integrator"), ("line", "collision"), ("marker", "geometry")):
        carom = [(getattr(look, what), getattr(cell, of)) for look, cell in zip(looks, cells, strict=True)][:-2]
        assert len(set(carom)) == len({shown for shown, _ in carom}) == len({meant for _, meant in carom})
    assert [look.line for look in looks[-2:]] == ["--", "--"]


# -- files ------------------------------------------------------------------------------------------------------


def test_draws_png_and_svg_for_each_measured_case(tmp_path):
    paths = draw(made.trade(made.bouncing(), made.refused()), tmp_path / "charts")
    assert [path.name for path in paths] == [
        f"trade-bouncing-energy_square-{quantity}.{kind}" for quantity in (WORK, TIME) for kind in ("png", "svg")
    ]
    assert paths[0].read_bytes().startswith(b"\x89PNG")
    assert ElementTree.fromstring(paths[1].read_text(encoding="utf-8")).tag.endswith("svg")


def test_two_cases_of_one_name_do_not_overwrite_each_other(tmp_path):
    case = made.bouncing()
    for curve in case.curves:
        for point in curve.points:
            point.milliseconds = None
    case.scene = "games/my scene.py"
    names = {path.name for path in draw(made.trade(case, case), tmp_path)}
    assert len(names) == 4
    assert "trade-games-my-scene-py-energy_square-work.svg" in names


def test_an_unknown_norm_and_a_file_in_the_way_are_problems(tmp_path):
    with pytest.raises(Problem, match="no case here has the norm 'speed'"):
        draw(made.trade(), tmp_path, "speed")
    (tmp_path / "file").write_text("")
    with pytest.raises(Problem, match="file"):
        draw(made.trade(made.bouncing()), tmp_path / "file")


def test_cases_with_hardly_anything_to_draw_are_drawn():
    """No curve, one point, errors of 0 alone, errors that are no numbers, failures alone, costs that are not known."""
    none, one, zero, odd, costless = (made.bouncing() for _ in range(5))
    none.curves = []
    assert lines(plot(figure(none)), "trusted") == []
    one.curves = [Curve("one", [Point(Cell(0.1), 1, {one.norm: ErrorBar.of([1.0])}, {}, {}, 5.0)])]
    assert lines(plot(figure(one)), "one") == [(1.0, 5.0)]
    assert len(figure(one).axes) == 1  # no strip of failures
    zero.curves = zero.curves[:1]
    assert len(lines(plot(figure(zero)), "zero")) == 3
    for place, value in enumerate((float("nan"), float("inf"))):
        odd.curves[1].points[place].errors["energy_square"] = ErrorBar(value, value, value, 0.0)
    assert len(lines(strip(figure(odd)), "not finite")) == 2
    costless.curves[2].points[0].work = 0.0
    assert any("work of 1 points is not known" in text for text in words(figure(costless)))
    failed = made.smooth(against=False)
    for point in failed.points:
        point.errors, point.failures = {}, {"blew up": point.repeats}
    assert len(lines(strip(figure(failed)), "blew up")) == 5 * len(made.STEPS)
