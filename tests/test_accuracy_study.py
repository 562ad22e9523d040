"""``studies accuracy`` and ``studies page``: short tables of a trade, published curves, and pages of the docs."""

from __future__ import annotations

import helpers_trade as made
import pytest
from click.testing import CliRunner

from carom.lab.studies.__main__ import cli
from carom.lab.studies.accuracy.published import published
from carom.lab.studies.accuracy.summary import summary
from carom.lab.trading.charts import TIME, WORK, figure
from carom.lab.trading.records import Trade


@pytest.fixture
def studies(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def invoke(*arguments: object):
        return CliRunner(env={"COLUMNS": "200"}).invoke(cli, [str(word) for word in arguments])

    return invoke


def test_published_points_follow_the_laws_that_are_known_of_them():
    curves = {curve.label: curve for curve in published("bouncing", "energy_square")}
    assert sum(len(curve.points) for curve in curves.values()) == 20
    assert published("orbit", "energy_square") == published("bouncing", "position") == []
    # ODE's error is the lag of semi-implicit Euler: (M g dt / 2)^2 2/3 g (H - R), M = 490 kg, H - R = 4.9 m
    lag = (490 * 9.81 / 2) ** 2 * 2 / 3 * 9.81 * 4.9
    of_ode = {point.cell.dt: point for point in curves["ODE, published"].points}
    for dt in (1e-5, 1e-4, 1e-3):
        assert of_ode[dt].errors["energy_square"].mean == pytest.approx(lag * dt**2, rel=1e-3)
    assert of_ode[1e-3].milliseconds.median == pytest.approx(1.89 / 20 * 1000)


def test_published_points_share_the_axes_of_wall_time():
    case = made.bouncing()
    case.curves += published("bouncing", "energy_square")
    by_time, by_work = figure(case, TIME), figure(case, WORK)
    drawn = {line.get_label(): line for line in by_time.axes[0].get_lines()}
    for engine in ("RaiSim", "ODE", "Bullet", "DART"):
        assert len(drawn[f"{engine}, published"].get_xdata()) == 5
    assert "The work of 20 points is not known: they are not here." in [text.get_text() for text in by_work.texts]


def test_the_summary_has_the_largest_step_of_each_method_that_meets_a_target():
    table = summary(made.smooth(), targets=(0.1, 0.01))
    assert table.headings == ("method", "position, order", "energy, order", "10 %", "1 %", "best", "failed")
    rows = {row[0]: row for row in table.rows}
    assert rows["rk4"][1:] == ("4.00 (4)", "5.00 (5)", "1/30: 2.7e6", "1/60: 5.4e6", "1.2e-8", "-")
    assert rows["explicit euler"][-1] == "1/15: tunnelled; 1/30: 2 of 64 escaped"


def test_the_study_writes_a_page_and_a_chart(studies, tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    page.write_text("a\n<!-- studies accuracy bouncing -->\nold\n<!-- end of studies accuracy bouncing -->\nz\n")
    asked = []

    def trade(scene: str, **options: object) -> Trade:
        asked.append((scene, options["against_pymunk"], options["command"]))
        return Trade(made.MACHINE, str(options["command"]), [made.bouncing()])

    monkeypatch.setattr("carom.lab.studies.accuracy.command.trade", trade)
    done = studies("accuracy", "bouncing", "--against", "pymunk", "--into", "page.md", "--out", "pictures")
    assert done.exit_code == 0, done.output
    command = "python -m carom.lab.studies accuracy bouncing --against pymunk --into page.md --out pictures"
    assert asked == [("bouncing", True, command)]
    text = page.read_text()
    assert text.startswith("a\n<!-- studies accuracy bouncing -->\n\n**bouncing: orders observed")
    assert text.endswith("\n\n<!-- end of studies accuracy bouncing -->\nz\n")
    assert command in text
    assert "published by SimBenchmark" in text
    assert (tmp_path / "pictures" / "trade-bouncing-energy_square-time.png").exists()


def test_what_a_command_prints_goes_into_a_page(studies, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Mine\n\n<!-- carom trade jump -->\nold\n<!-- end of carom trade jump -->\nend\n")
    options = ("--dt", "1/30,1/60", "--repeats", "2", "--no-timing", "--workers", "1", "--thorough")
    done = studies("page", "page.md", "trade", "jump", *options)
    assert done.exit_code == 0, done.output
    text = page.read_text()
    assert "old" not in text
    assert "| velocity verlet |" in text
    assert text.startswith("# Mine\n\n<!-- carom trade jump -->\n\n**jump")
    assert text.endswith("\n\n<!-- end of carom trade jump -->\nend\n")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("page", "page.md", "bench", "--repeats", "2"), "it has no line <!-- carom bench -->"),
        (("page", "nowhere.md", "bench"), "nowhere.md: No such file"),
        (("accuracy", "spring", "--into", "page.md"), "it has no line <!-- studies accuracy spring -->"),
    ],
)
def test_a_page_without_the_marks_is_refused_before_the_run(studies, tmp_path, arguments, words):
    (tmp_path / "page.md").write_text("nothing\n")
    done = studies(*arguments)
    assert done.exit_code == 2
    assert words in done.stderr
