"""``carom bench``: the timed steps, results as records, and the command.

Nothing here asserts a time, because any time is possible on a busy machine. The tests check the meaning of the figures.
"""

from __future__ import annotations

import itertools
import json
import re
import sys

import helpers_cli
import pytest

from carom.framework.jit.log import CompilationLog
from carom.lab.bench import report as bench_report
from carom.lab.bench.against_pymunk import QUERIES, bench
from carom.lab.bench.suite import Subject, Window, subjects
from carom.lab.cli.usage_errors import Problem
from carom.lab.engines import pymunk_space as peer_pymunk
from carom.lab.measure import timing as bench_clock
from carom.lab.reporting.progress import Progress

carom = helpers_cli.carom  # fixture
SHORT_GAS = Subject("gas2d", (Window("first", 2, 12), Window("later", 20, 40)))


@pytest.fixture
def no_pymunk(monkeypatch):
    """As if pymunk were not installed."""
    monkeypatch.setitem(sys.modules, "pymunk", None)


# -- the runs ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def result() -> bench_report.Result:
    return bench([SHORT_GAS], (30,), repeats=3)


def test_a_row_for_each_window_with_ratios_within_repeats(result):
    assert [row.window for row in result.rows] == ["first", "later"]
    assert [row.timed for row in result.rows] == [10, 20]
    for row in result.rows:
        assert row.bodies == 30
        assert row.peer_index in peer_pymunk.INDEXES
        assert len(row.ratio.values) == len(row.carom_ms.values) == len(row.peer_ms.values) == 3
        for ratio, own, other in zip(row.ratio.values, row.carom_ms.values, row.peer_ms.values, strict=True):
            assert ratio == pytest.approx(other / own)
        assert row.ratio.low <= row.ratio.median <= row.ratio.high
        for figures in row.quality.values():
            assert figures["kinetic_end"] == pytest.approx(figures["kinetic_start"], rel=0.05)
            assert figures["escaped"] == 0


def test_settings_of_both_are_stated(result):
    assert result.settings["carom"]["dt"] == 1 / 60
    peer = dict(result.settings["pymunk"])
    assert peer.pop("collision_slop") == pytest.approx(0.1)
    assert peer.pop("collision_bias") == pytest.approx(0.9**60, rel=1e-4)
    assert peer == {"iterations": 10, "damping": 1.0, "threads": 1, "sleeping": False}
    text = "\n".join(bench_report.remarks(result))
    for word in ("dt 1/60", "substeps", "iterations 10", "collision_slop 0.1", "pymunk 7", "compiling"):
        assert word in text


def test_settings_of_a_subject_are_used_kept_and_named():
    """Swept, no disc leaves the box that some leave otherwise; the settings of other subjects stay at their
    defaults."""
    window = (Window("", 0, 40),)
    swept = Subject("fastgas", window, variant="swept", settings={"collision": "continuous"}, sizes=(100,))
    plain = Subject("fastgas", window, variant="plain", sizes=(100,))
    found = bench([swept, plain], (1000,), repeats=1, peer=False)
    assert [row.settings for row in found.rows] == [{"collision": "continuous"}, {}]
    one, other = (row.quality["carom"]["escaped"] for row in found.rows)
    assert one == 0 < other
    assert found.settings["carom"]["collision"] == "discrete"
    assert "collision discrete, substeps 4; fastgas, swept: collision continuous" in bench_report.remarks(found)[2]


def test_queries_find_the_same_in_both_engines():
    """But for boxes: pymunk tests the bounding boxes of the discs, and finds a few more."""
    rows = bench(subjects(["player_query"]), (300,), repeats=1).rows
    assert [row.window for row in rows] == [query.name for query in QUERIES]
    for row in rows:
        (own,), (other,) = (figures.values() for figures in row.quality.values())
        if row.window.startswith("box"):
            assert own <= other <= 1.05 * own
        else:
            assert own == pytest.approx(other, rel=1e-9)


def test_steps_in_which_kernels_came_do_not_count(monkeypatch):
    """The first step of each window is disturbed: its time is left out, for both engines."""
    calls = itertools.count()

    def timed(work):
        work()
        number = next(calls)
        return (1000.0, False, None) if number == 0 else (3.0, True, None)

    monkeypatch.setattr("carom.lab.bench.against_pymunk.timed", timed)
    subject = Subject("gas2d", (Window("", 0, 10),))
    row = bench([subject], (10,), repeats=1).rows[0]
    assert row.ratio is not None
    assert row.carom_ms.median == pytest.approx(3000.0)
    assert row.ratio.median == pytest.approx(1.0)
    monkeypatch.setattr("carom.lab.bench.against_pymunk.timed", lambda work: (1.0, False, None))
    with pytest.raises(Problem, match="run it once more"):
        bench([subject], (10,), repeats=1)


def test_a_quick_comparison_leaves_out_what_turns_slowly_unless_it_is_named():
    left_out = {subject.name for subject in subjects()} - {subject.name for subject in subjects(quick=True)}
    assert left_out == {"pyramid, turning", "tumbler", "rubble", "bridge", "bridge, a chain", "ragdoll"}
    assert {subject.scene for subject in subjects(["rubble"], quick=True)} == {"rubble"}


def test_progress_ends_where_it_said():
    class Recorder(Progress):
        total = 0.0

        def begin(self, total):
            self.total = total

    recorder = Recorder()
    bench([SHORT_GAS], (10, 20), repeats=2, peer=False, progress=recorder)
    assert recorder.done == pytest.approx(recorder.total)


def test_timed_says_what_came_meanwhile(monkeypatch):
    log = CompilationLog()
    monkeypatch.setattr(bench_clock, "log", log)
    assert bench_clock.timed(lambda: 7)[1:] == (True, 7)
    assert bench_clock.timed(lambda: setattr(log, "waited", 0.1))[1] is False


# -- the command ------------------------------------------------------------------------------------------------


TINY = ("bench", "--scenes", "fastgas", "--repeats", "1")


@pytest.fixture
def tiny(monkeypatch):
    """One scene, 20 bodies, 10 steps."""
    monkeypatch.setattr("carom.lab.bench.suite.SUITE", (Subject("fastgas", (Window("", 0, 10),), sizes=(20,)),))


def test_json_is_all_there_is_on_stdout(carom, tiny):
    done = carom(*TINY, "--json")
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["rows"][0]["scene"] == "fastgas"


def test_tables_and_charts(carom, tiny, tmp_path):
    done = carom(*TINY, "--markdown", "--out", "pictures")
    assert done.exit_code == 0, done.stderr
    assert "| fastgas 20 |" in done.stdout
    assert (tmp_path / "pictures" / "bench.png").stat().st_size > 1000
    plain = carom(*TINY)
    assert "fastgas 20" in plain.stdout
    assert "quality" in plain.stdout


def test_without_pymunk_it_times_carom_and_says_what_is_missing(carom, tiny, no_pymunk):
    done = carom(*TINY, "--json")
    assert done.exit_code == 0, done.stderr
    assert "carom[bench]" in done.stderr
    assert json.loads(done.stdout)["rows"][0]["ratio"] is None
    alone = carom(*TINY, "--no-peer", "--out", "p").stderr
    assert "carom[bench]" not in alone
    assert "no chart: nothing is compared" in alone


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["bench", "--scenes", "gas2"], ["'gas2' is not measured", "did you mean 'gas2d'?"]),
        (["bench", "--scenes", "jump"], ["'jump' is not measured"]),
        (["bench", "--sizes", "many"], ["--sizes", "'many'"]),
        (["bench", "--sizes", "0"], ["--sizes", "0 is not in the range"]),
        (["bench", "--quick", "--large"], ["--quick"]),
        (["bench", "--json", "--markdown"], ["exclude each other"]),
        (["bench", "--repeats", "0"], ["--repeats"]),
    ],
    ids=lambda value: " ".join(value[1:]) if value and value[0] == "bench" else "",
)
def test_wrong_names_and_values(carom, arguments, words):
    done = carom(*arguments)
    assert done.exit_code == 2
    lines = done.stderr.splitlines()
    assert len(lines) == 1
    for word in words:
        assert word in lines[0]


def test_ctrl_c_stops_with_one_line(carom, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("carom.lab.bench.command.bench", interrupted)
    done = carom("bench")
    assert done.exit_code == 130
    assert done.stderr.strip().splitlines()[-1] == "carom: stopped"


def test_a_scene_that_begins_at_rest_shows_what_energy_is_left(carom):
    result = carom("bench", "--scenes", "pyramid", "--no-peer", "--repeats", "1")
    assert result.exit_code == 0, result.stderr
    assert re.search(r"pyramid.* J ", result.stdout)
