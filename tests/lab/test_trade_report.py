"""A trade as tables, sentences, files and lines of Python: made of points with known figures."""

from __future__ import annotations

import csv
import json
import math

import helpers_trade as made
import pytest
from hypothesis import given
from hypothesis import strategies as st

from carom.framework import Settings
from carom.lab.cli.usage_errors import Problem
from carom.lab.reporting.text import TextTable
from carom.lab.trading import report as trade_report
from carom.lab.trading.records import PYMUNK, Cell, Trade, python_line, settings_line
from carom.lab.trading.report import COLUMNS, write_csv, write_json


def column(table: TextTable, heading: str) -> list[str]:
    place = table.headings.index(heading)
    return [row[place] for row in table.rows]


# -- the table of all points ------------------------------------------------------------------------------------


def test_error_with_uncertainty_and_worst_as_the_power_of_the_step_says():
    table = made.trade(made.smooth())
    rows = {(row[0], row[2]): row for row in trade_report.tables(table)[0].rows}
    # rk4 at 1/30 s: 0.1 / 2^4, five percent of it, and twice it
    assert rows["rk4", "1/30"][3:5] == ("0.00625 ± 3e-4", "0.0125")
    assert rows["velocity verlet", "1/60"][3:5] == ("0.00625 ± 3e-4", "0.0125")


def test_observed_order_beside_the_theory_once_for_each_curve():
    orders = [text for text in column(trade_report.points_table(made.smooth(), "position"), "order") if text]
    assert orders == ["1.00 (1)", "1.00 (1)", "2.00 (2)", "4.00 (4)", "4.00 (4)", "1.00 (1)"]
    orders = [text for text in column(trade_report.points_table(made.bouncing(), "energy_square"), "order") if text]
    assert orders == ["(exact)", "2.00 (2)", "1.50 (2)"]


def test_another_norm_can_be_chosen():
    tables = trade_report.tables(made.trade(made.smooth(), made.bouncing()), "energy")
    assert tables[0].title.startswith("orbit: energy,")
    assert tables[1].title.startswith("bouncing: energy_square")  # it has no other
    assert "worst" not in tables[0].headings  # no repeat differs


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"), (0.0123456, "0.0123"), (1234.0, "1,230"), (123456.0, "123,000"), (1.2345e-5, "1.23e-5"),
        (4.56e7, "4.56e7"), (999_999.0, "1.00e6"), (0.00099996, "0.00100"), (math.inf, "inf"), (-0.5, "-0.500"),
    ],
)  # fmt: skip
def test_compact_numbers(value, text):
    assert trade_report.compact(value) == text


# -- remarks ----------------------------------------------------------------------------------------------------


def test_remarks_name_kind_reference_norm_and_command():
    text = "\n".join(trade_report.remarks(made.trade()))
    for part in (
        "carom trade orbit bouncing",
        "a processor, Linux; python 3.13",
        "orbit: smooth: no impact",
        "10 s simulated, 64 start phases",
        "position: largest error of a position at the end, relative to",
        "reference: own runs of rk4 and yoshida4 at 1/7,680 s (position: 1.00e-9 apart)",
        "my_scene.py: not measured: there is no wall",
        "two starts 1e-9 apart",
    ):
        assert part in text


def test_untrusted_errors_are_marked_and_explained():
    case = made.smooth()
    marked = [text for text in column(trade_report.points_table(case, "position"), "error") if text.endswith("*")]
    # 0.1 / 64^4 = 6e-9 is below ten times 1e-9: the last points of the two methods of fourth order
    assert len(marked) == 2
    assert any("* 2 of the errors are below 1.00e-8" in line for line in trade_report.case_remarks(case, "position"))
    assert not any("*" in line for line in trade_report.case_remarks(case, "energy"))


# -- the line of Python -----------------------------------------------------------------------------------------

NAMES = st.sampled_from([*made.METHODS, "own", 'quoted"one', "back\\slash"])
STEPS = st.one_of(
    st.integers(1, 10_000).map(lambda n: 1 / n),
    st.tuples(st.integers(1, 20), st.integers(1, 2000)).map(lambda pair: pair[0] / pair[1]),
    st.floats(1e-300, 1e300),
    st.integers(1, 10),
)
CELLS = st.builds(
    Cell, dt=STEPS, integrator=NAMES, collision=st.sampled_from(["discrete", "continuous", "event_driven"]),
    substeps=st.integers(1, 100), geometry=st.sampled_from(["precise", "bounds"]),
)  # fmt: skip
BASES = st.builds(
    Settings, slop=st.none() | st.floats(0, 1), restitution_threshold=st.none() | st.floats(0, 10),
    friction_mixing=st.sampled_from(["average", "geometric_mean"]), debug=st.booleans(),
)  # fmt: skip


@given(CELLS, BASES)
def test_the_line_evaluates_to_the_same_settings(cell, base):
    assert eval(settings_line(cell, base), {"Settings": Settings}) == cell.settings(base)


def test_another_engine_has_no_settings():
    cell = Cell(1 / 120, "its own", engine=PYMUNK, substeps=20)
    with pytest.raises(ValueError, match="a cell of pymunk has no Settings"):
        settings_line(cell)
    assert python_line(cell) == "space.iterations = 20; space.step(1/120)"


# -- files ------------------------------------------------------------------------------------------------------


def test_json_goes_back_into_the_same_records(tmp_path):
    trade = made.trade()
    path = write_json(trade, tmp_path / "new" / "trade.json")
    assert Trade.from_dict(json.loads(path.read_text())) == trade


def test_csv_has_a_row_for_each_point_and_norm(tmp_path):
    trade = made.trade()
    with write_csv(trade, tmp_path / "trade.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 6 * len(made.STEPS) * 2 + 9
    assert list(rows[0]) == list(COLUMNS)
    first, exact = rows[0], [row for row in rows if row["theory"] == "exact"]
    assert (first["method"], first["failed"], first["error"]) == ("explicit euler", "tunnelled 64", "")
    assert len(exact) == 3
    finest = [row for row in rows if row["method"] == "rk4" and row["norm"] == "position"][-1]
    assert float(finest["dt"]) == made.STEPS[-1]
    assert float(finest["error"]) == pytest.approx(0.1 / 64**4, rel=1e-12)
    assert finest["trusted"] == "0"


def test_files_that_cannot_be_written_are_a_problem(tmp_path):
    (tmp_path / "file").write_text("")
    for write in (write_json, write_csv):
        with pytest.raises(Problem, match="file"):
            write(made.trade(), tmp_path / "file" / "trade")
