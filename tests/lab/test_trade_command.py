"""`carom trade`: the answer, the table, the chart, and one line for what it cannot do."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from helpers_trade_scenes import BALL, BULLET, CROWD, scene_file

from carom.framework import Settings
from carom.lab.cli.loading import load
from carom.lab.cli.main import cli
from carom.lab.trading import grid
from carom.lab.trading import trade as trade_module
from carom.lab.trading.chart import figure
from carom.lab.trading.command import trade_command
from carom.lab.trading.errors import NORMS

SHORT = ("--dt", "1/30,1/60", "--repeats", "2", "--no-timing", "--workers", "1")


@pytest.fixture
def carom(tmp_path, monkeypatch):
    """Runs the command in an empty folder; the result has exit_code, stdout and stderr."""
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner(env={"COLUMNS": "200"}).invoke(cli, ["trade", *words])


@pytest.mark.slow
def test_five_lines_a_table_and_a_chart(carom, tmp_path):
    scene_file(tmp_path, BULLET)
    result = carom("mine.py", "--dt", "1/30,1/60", "--repeats", "4")
    assert result.exit_code == 0, result.output
    lines, table = result.stdout.split("\n\n", 1)
    first, *rest = lines.splitlines()
    assert re.match(r"mine\.py: use Settings\(.*\), [\d.]+ times the cost of Settings\(\) now", first)
    assert [line.split()[0] for line in rest] == ["now", "use"]
    assert "us per frame of 1/60 s on this machine" in rest[1]
    assert "escaped" in rest[0] or "missed a contact" in rest[0]
    for words in ("mine.py: worst error of all runs (position)", "reference: event_driven, steps of 1/120"):
        assert words in table, words
    assert (tmp_path / "out/trade/trade-mine-py.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_newcomers_file_is_measured_and_the_line_keeps_the_error(carom, tmp_path):
    """1.25 m above the ground, no loss: impacts at sqrt(0.2) s and 3 sqrt(0.2) s."""
    mine = scene_file(tmp_path, BALL)
    result = carom("mine.py", "--max-error", "0.001", *SHORT)
    assert result.exit_code == 0, result.output
    assert "5.1 mm allowed in position" in result.stdout
    settings = eval(result.stdout.partition("use ")[2].partition(")")[0] + ")", {"Settings": Settings})
    with load(mine).function(settings) as world:
        for _ in range(round(1.7 / settings.dt)):
            world.step()
        since_apex = 1.7 - 4 * 0.2**0.5
        assert world.bodies.dynamic.position[0, 1] == pytest.approx(1.25 - 5 * since_apex**2, abs=1e-3 * 3.0 * 1.7)


@pytest.mark.slow
def test_what_a_game_prints_does_not_go_to_stdout(carom, tmp_path):
    speaks = "class Speaks(System):\n    def process(self, dt):\n        print('said')\n"
    world = "world = World(Physics(dimensions=2, gravity=(0.0, -10.0)), settings=settings)"
    game = BALL.replace(world, f"{world}\n    world.add_system(Speaks())")
    scene_file(tmp_path, f"from carom.framework import System\n{speaks}{game}")
    result = carom("mine.py", *SHORT, "--seconds", "0.3", "--json")
    assert json.loads(result.stdout)["scenes"]
    assert "said" in result.stderr


@pytest.mark.slow
def test_json_alone_goes_to_stdout_and_nothing_runs_twice(carom, monkeypatch):
    pytest.importorskip("joblib")
    first = carom("jump", *SHORT, "--json")
    assert first.exit_code == 0, first.output
    found = json.loads(first.stdout)
    assert found["command"] == f"carom trade jump {' '.join(SHORT)} --json"
    assert found["scenes"][0]["chosen"]["line"] == 'Settings(dt=1/30, integrator="velocity_verlet")'
    monkeypatch.setattr(grid, "Observer", None)  # no task runs
    assert carom("jump", *SHORT, "--json").stdout == first.stdout


@pytest.mark.slow
def test_several_scenes_one_of_them_refused(carom, tmp_path):
    scene_file(tmp_path, CROWD, "crowd.py")
    result = carom("crowd.py", "jump", "--norm", "position", *SHORT, "--markdown")
    assert result.exit_code == 0, result.output
    assert "**jump: worst error of all runs (position)" in result.stdout
    assert "| velocity verlet" in result.stdout
    assert (tmp_path / "out/trade/trade-jump-position.png").exists()
    plain = carom("crowd.py", "jump", "--norm", "position", *SHORT)
    assert "crowd.py: not measured: crowd.py is chaotic" in plain.stdout


@pytest.mark.slow
def test_options_reach_the_scene_and_the_grid(carom, tmp_path):
    scene_file(tmp_path, BALL)
    result = carom(
        "mine.py", *SHORT, "--option", "speed=2.5", "--integrators", "velocity_verlet", "--collisions",
        "continuous,event_driven", "--seconds", "0.6", "--norm", "count", "--norm", "position", "--seed", "3", "--json",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    (case,) = json.loads(result.stdout)["scenes"]
    settings = [point["settings"] for point in case["points"] if point["asked"]]
    asked = {(one["integrator"], one["collision"]) for one in settings}
    assert asked == {("velocity_verlet", "continuous"), ("velocity_verlet", "event_driven")}
    assert (case["seconds"], list(case["norms"])) == (0.6, ["count", "position"])
    charts = {path.name for path in Path("out/trade").glob("*.png")}
    assert charts == {"trade-mine-py-count.png", "trade-mine-py-position.png"}


@pytest.mark.slow
def test_the_chart_tells_what_is_noticed_what_failed_and_what_to_use(tmp_path):
    case = trade_module.trade(scene_file(tmp_path, BULLET), vary={"dt": (1 / 30,)}, timing=False).scenes[0]
    (axes,) = figure(case).axes
    drawn = axes.get_lines()
    assert {line.get_label() for line in drawn} >= {"discrete", "continuous", "event driven"}
    assert sum(line.get_marker() == "x" for line in drawn) == sum(bool(point.failed) for point in case.points) > 0
    assert {text.get_text() for text in axes.texts} >= {"use: 1/30 s"}
    assert axes.get_xscale() == axes.get_yscale() == "log"
    assert "position error" in figure(case, "position").axes[0].get_xlabel()


@pytest.mark.slow
def test_without_matplotlib_everything_but_pictures(carom, monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"] + ["carom.lab.trading.chart"]:
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = carom("jump", *SHORT)
    assert result.exit_code == 0, result.output
    assert "carom: no charts, matplotlib is missing" in result.stderr
    assert not list(Path("out/trade").iterdir())


@pytest.mark.slow
@pytest.mark.parametrize(("target", "words"), [
    (("--max-error", "1e-4", "--integrators", "explicit_euler"), "no settings keep the position error below 0.0001"),
    pytest.param(
        ("--max-error", "1e-14"), "no reference is exact enough for a position error of 1e-14", marks=pytest.mark.long
    ),
])  # fmt: skip
def test_a_target_that_nothing_meets(carom, target, words):
    result = carom("spring", *target, *SHORT, "--seconds", "0.5")
    assert result.exit_code == 2
    assert words in result.stderr.splitlines()[-1]
    assert result.stderr.splitlines()[-1].startswith("carom: spring: ")


@pytest.mark.slow
def test_a_cost_that_nothing_meets(carom):
    result = carom("jump", "--max-cost", "1e-9", "--dt", "1/30", "--repeats", "1", "--seconds", "0.5")
    assert result.exit_code == 2
    assert "nothing that was tried costs 1e-09 ms a frame or less: the cheapest, Settings(" in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("arguments", "words"), [
    (("sprin",), "no scene named 'sprin'; did you mean 'spring'"),
    (("gone.py",), "no file 'gone.py'"),
    ((), "Missing argument"),
    (("spring", "--norm", "positon"), "no norm 'positon'; did you mean 'position'"),
    (("spring", "--dt", "1/60,x"), "'--dt': 'x' is not a finite number"),
    (("spring", "--seconds", "0"), "'--seconds': 0.0 is not in the range"),
    (("spring", "--repeats", "0"), "--repeats"),
    (("spring", "--integrators", "rk5"), "did you mean 'rk4'"),
    (("spring", "--integrators", ","), "'--integrators': ',' names none"),
    (("spring", "--collisions", "discreet"), "'--collisions': 'discreet' is not one of 'discrete'"),
    (("spring", "--option", "n"), "'--option': 'n' is not NAME=VALUE"),
    (("spring", "--option", "seed=1"), "--option cannot set seed"),
    (("spring", "--option", "mass=3"), "spring: --option mass=3: build got an unexpected keyword argument 'mass'"),
    (("raises.py", "--option", "n=1"), "raises.py: --option n=1: build got an unexpected keyword argument 'n'"),
    (("spring", "--json", "--markdown"), "--json and --markdown exclude each other"),
    (("spring", "--max-cost", "-1"), "'--max-cost': -1.0 is not in the range"),
    (("spring", "--max-cost", "1", "--no-timing"), "--max-cost needs times"),
    (("spring", "--absolute"), "--absolute is about --max-error"),
    (("spring", "--workers", "2", "--cluster", "tcp://a:1"), "--workers and --cluster exclude each other"),
    (("raises.py",), "raises.py, line 2: ZeroDivisionError"),
])  # fmt: skip
def test_wrong_input_is_refused_in_one_line(carom, arguments, words):
    Path("raises.py").write_text("def build(settings, seed=0):\n    1 / 0\n")
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


def test_the_manual_has_every_option_and_norm():
    text = (Path(__file__).parents[2] / "docs" / "trade.md").read_text(encoding="utf-8")
    options = {o for parameter in trade_command.params for o in parameter.opts if o.startswith("--")}
    rows = "".join(row.split(" | ")[0] for row in text.splitlines() if row.startswith("| `--"))
    assert set(re.findall(r"`(--[a-z-]+)", rows)) == options
    assert [name for name in NORMS if f"`{name}`" not in text] == []
