"""`carom trade`: its output, and its errors for invalid input."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from helpers_trade_scenes import BALL, BULLET, CROWD, scene_file

from carom.lab import Trade
from carom.lab.cli.main import cli
from carom.lab.jobs import runs as trade_runs
from carom.lab.jobs.tasks import perform
from carom.lab.measure.norms import NORMS
from carom.lab.trading import command as trade_command
from carom.lab.trading.answer import answer

pytestmark = [pytest.mark.slow, pytest.mark.early]  # many runs: half a minute or more together

SHORT = ("--dt", "1/30,1/60", "--repeats", "2", "--no-timing", "--workers", "1", "--thorough")
WRITTEN = {"trade.json", "trade.csv"}


@pytest.fixture
def carom(tmp_path, monkeypatch):
    """Runs the command in an empty folder; the result has exit_code, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str):
        return CliRunner(env={"COLUMNS": "200"}).invoke(cli, ["trade", *arguments])

    return run


@pytest.fixture
def no_charts(monkeypatch):
    """For what other tests have drawn."""
    monkeypatch.setattr(trade_command, "drawing_if_there", lambda *_: None)


def trade_in(folder: Path) -> Trade:
    return Trade.from_dict(json.loads((folder / "trade.json").read_text()))


# -- output ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """(folder, result) for a bullet that discrete collisions miss, with pymunk; timed."""
    folder = tmp_path_factory.mktemp("made")
    mine = scene_file(folder, BULLET, first_line="A bullet & <a wall>.")
    words = [mine, "--dt", "1/15,1/60", "--repeats", "4", "--workers", "1", "--against", "pymunk", "--thorough"]
    result = CliRunner(env={"COLUMNS": "200"}).invoke(cli, ["trade", *words, "--out", str(folder / "out")])
    assert result.exit_code == 0, result.output
    return folder / "out", result


def test_the_files_it_writes_are_there_and_named(made):
    folder, result = made
    charts = {f"trade-mine-py-position-{what}.{kind}" for what in ("work", "time") for kind in ("png", "svg")}
    expected = WRITTEN | charts
    assert {path.name for path in folder.iterdir()} == expected
    for name in expected:
        assert f"written: {folder / name}" in result.stderr


def test_failures_are_in_the_table_and_on_the_chart(made):
    folder, result = made
    [case] = trade_in(folder).cases
    [kind] = {kind for curve in case.curves for point in curve.points for kind in point.failures}
    assert kind in result.stdout
    assert kind in (folder / "trade-mine-py-position-work.svg").read_text()


def test_what_it_prints(made):
    _, result = made
    for words in (
        "mine.py: position, and work", "order", "pymunk, 10 iterations", "reference: own runs",
    ):  # fmt: skip
        assert words in result.stdout, words
    assert "solver loops" not in result.stdout  # a terminal is too narrow


@pytest.mark.usefixtures("no_charts")
def test_json_alone_goes_to_stdout_and_nothing_runs_twice(carom, monkeypatch):
    first = carom("jump", *SHORT)
    assert first.exit_code == 0, first.output
    before = trade_in(Path("out/trade"))
    assert before.command == f"carom trade jump {' '.join(SHORT)}"
    monkeypatch.setattr(trade_runs, "perform", None)  # no task runs
    again = carom("jump", *SHORT, "--json")
    assert Trade.from_dict(json.loads(again.stdout)).cases == before.cases


def test_several_scenes_one_of_them_refused(carom, tmp_path):
    scene_file(tmp_path, CROWD, "crowd.py")
    result = carom("crowd.py", "jump", "--norm", "position", *SHORT, "--markdown")
    assert result.exit_code == 0, result.output
    assert "crowd.py: not measured: " in result.stdout
    assert "**jump: position, and work" in result.stdout
    assert "| explicit euler |" in result.stdout
    assert (tmp_path / "out/trade/trade-jump-position-work.png").exists()


def test_options_reach_the_scene_and_the_grid(carom, tmp_path):
    scene_file(tmp_path, BALL)
    result = carom(
        "mine.py", *SHORT, "--option", "speed=2.5", "--integrators", "velocity_verlet", "--collisions",
        "continuous,event_driven", "--seconds", "1", "--norm", "count", "--norm", "position", "--seed", "3",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    [case] = trade_in(Path("out/trade")).cases
    cells = [curve.points[0].cell for curve in case.curves]
    assert [(cell.integrator, cell.collision) for cell in cells] == [
        ("velocity_verlet", "continuous"), ("velocity_verlet", "event_driven"),
    ]  # fmt: skip
    assert (case.seconds, list(case.norms)) == (1.0, ["count", "position"])
    charts = {path.name for path in Path("out/trade").glob("*.png")}
    assert charts == {"trade-mine-py-count-work.png", "trade-mine-py-position-work.png"}


FEW = (
    "--no-timing", "--dt", "1/15,1/30", "--integrators", "velocity_verlet", "--seconds", "0.6", "--norm", "apex",
    "--workers", "1",
)  # fmt: skip


@pytest.mark.usefixtures("no_charts")
def test_it_answers_in_five_lines_first_and_then_from_more_runs(carom, monkeypatch):
    shown = []
    monkeypatch.setattr(trade_command, "answer", lambda *known: shown.append(known[0]) or answer(*known))
    result = carom("jump", *FEW)
    assert result.exit_code == 0, result.output
    first, second, _ = result.stdout.split("\n\n", 2)
    assert first.startswith("first look: jump: use Settings(")
    for lines in (first.splitlines(), second.splitlines()):
        assert len(lines) <= 5
        assert [line.split()[0] for line in lines[1:3]] == ["cost", "error"]
    assert [case.repeats for case in shown] == [1, 8]
    found = trade_in(Path("out/trade")).cases
    assert carom("jump", *FEW).exit_code == 0
    assert trade_in(Path("out/trade")).cases == found
    assert carom("jump", *FEW, "--thorough").exit_code == 0
    assert trade_in(Path("out/trade")).cases[0].repeats == 64


def test_without_matplotlib_everything_but_pictures(carom, monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"] + ["carom.lab.trading.charts"]:
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = carom("jump", *SHORT)
    assert result.exit_code == 0, result.output
    assert "carom: no charts, matplotlib is missing" in result.stderr
    assert {path.name for path in Path("out/trade").iterdir()} == WRITTEN


@pytest.mark.usefixtures("no_charts")
def test_an_interruption_says_what_is_kept_and_how_to_go_on(carom, monkeypatch):
    ran = []

    def interrupted(task):
        if len(ran) == 3:
            raise KeyboardInterrupt
        ran.append(task)
        return perform(task)

    with monkeypatch.context() as patched:
        patched.setattr(trade_runs, "perform", interrupted)
        result = carom("jump", *SHORT)
    assert result.exit_code == 130
    last = result.stderr.splitlines()[-1]
    assert last == "carom: stopped; 3 runs kept in out/runs.sqlite, the same command goes on"
    assert carom("jump", *SHORT).exit_code == 0


# -- refused input --------------------------------------------------------------------------------


@pytest.mark.parametrize(("arguments", "words"), [
    (("sprin",), "no scene named 'sprin'; did you mean 'spring'"),
    (("gone.py",), "no file 'gone.py'"),
    ((), "Missing argument"),
    (("spring", "--norm", "positon"), "no norm 'positon'; did you mean 'position'"),
    (("spring", "--dt", "1/60,x"), "--dt takes steps above 0 s"),
    (("spring", "--seconds", "0"), "--seconds takes a number above 0"),
    (("spring", "--repeats", "0"), "--repeats"),
    (("spring", "--against", "bullet"), "--against"),
    (("spring", "--integrators", "rk5"), "did you mean 'rk4'"),
    (("spring", "--integrators", ","), "--integrators takes names"),
    (("spring", "--collisions", "discreet"), "--collisions: no 'discreet'; did you mean 'discrete'"),
    (("spring", "--geometry", "box"), "--geometry: no 'box'; there are: precise, bounds"),
    (("spring", "--option", "n"), "--option takes NAME=VALUE"),
    (("spring", "--option", "seed=1"), "--option cannot set seed"),
    (("spring", "--option", "n=1", "--option", "n=2"), "--option gives n twice"),
    (("spring", "--option", "mass=3"), "mass"),
    (("spring", "--json", "--markdown"), "--json and --markdown exclude each other"),
])  # fmt: skip
def test_wrong_input_is_refused_at_once_in_one_line(carom, monkeypatch, arguments, words):
    monkeypatch.setattr(trade_runs, "perform", None)  # no task runs before
    result = carom(*arguments)
    assert result.exit_code == 2
    assert words in result.stderr.splitlines()[-1]
    assert result.stderr.splitlines()[-1].startswith("carom: ")
    assert result.stdout.strip() == ""


def test_a_folder_that_cannot_be_written(carom):
    Path("out").write_text("a file")
    result = carom("spring")
    assert result.exit_code == 2
    assert "--out" in result.stderr


def test_without_pymunk(carom, monkeypatch):
    monkeypatch.setitem(sys.modules, "pymunk", None)
    result = carom("spring", "--against", "pymunk")
    assert result.exit_code == 2
    assert "pymunk is missing" in result.stderr


def test_the_manual_has_every_option_and_norm():
    text = (Path(__file__).parents[2] / "docs" / "trade.md").read_text(encoding="utf-8")
    options = {o for parameter in trade_command.trade_command.params for o in parameter.opts if o.startswith("--")}
    rows = "".join(row.split(" | ")[0] for row in text.splitlines() if row.startswith("| `--"))
    assert set(re.findall(r"`(--[a-z-]+)", rows)) == options
    assert [name for name in NORMS if f"`{name}`" not in text] == []
