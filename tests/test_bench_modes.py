"""The same bodies in each collision mode; times are left to the benchmark itself."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math

import numpy as np
import pytest
from click.testing import CliRunner

from carom.lab.cli.usage_errors import Problem
from carom.lab.studies.__main__ import cli
from carom.lab.studies.bench import collision_modes as bench_modes
from carom.lab.studies.bench.collision_modes import COURSES, KINDS, ONE_SWEPT, Course, Modes, modes

STEPS, REPEATS = 12, 2
# With so few bodies the box is small: in 40 steps each of fastgas meets walls many times.
SMALL = (
    Course("gas2d", 60, kinds=("discrete", ONE_SWEPT, "continuous", "event_driven"), limits={
        "continuous": {"ratio": 1.5}, "event_driven": {"ratio": 5, "µs per impact": 1.5},
    }),
    Course("fastgas", 100, first=20, limits={"continuous": {"escaped": 0, "capped": 0}}),
    Course("pile2d", 30, "settled", first=2, share=0.25, energy="left"),
)  # fmt: skip


@pytest.fixture(scope="module")
def result() -> Modes:
    return modes(STEPS, REPEATS, courses=SMALL)


def costs_of(result: Modes, scene: str) -> dict[str, bench_modes.ModeCost]:
    return {cost.kind: cost for cost in result.costs if cost.scene == scene}


def test_each_scene_has_each_kind_with_its_ratio_to_discrete_within_repeats(result):
    assert [(cost.scene, cost.kind) for cost in result.costs] == [(c.label, kind) for c in SMALL for kind in c.kinds]
    for cost in result.costs:
        plain = costs_of(result, cost.scene)["discrete"].milliseconds.values
        assert len(plain) == REPEATS
        assert min(cost.milliseconds.values) > 0
        for ratio, own, other in zip(cost.ratio.values, cost.milliseconds.values, plain, strict=True):
            assert ratio == pytest.approx(own / other)
    assert [cost.steps for cost in result.costs] == [12] * 7 + [3] * 3


def test_what_an_impact_takes_is_of_the_step_and_of_the_loop_in_it(result):
    """All bodies of fastgas have impacts in a step, so each step has impacts, and the kernel of that name handles them.

    A pile that has just begun to fall has fewer than one per step: no figure then.
    """
    for kind, cost in costs_of(result, "fastgas 100").items():
        assert cost.rounds >= 1
        if kind == "discrete":
            continue
        assert cost.impacts > 100
        assert cost.step_us is not None
        assert cost.loop_us is not None
        for whole, loop in zip(cost.step_us.values, cost.loop_us.values, strict=True):
            assert 0 < loop < whole
        np.testing.assert_allclose(np.mean(cost.milliseconds.values) * 1e3, cost.impacts * np.mean(cost.step_us.values),
                                   rtol=0.3)  # means of products, not products of means  # fmt: skip
    for cost in costs_of(result, "pile2d 30 settled").values():
        assert cost.impacts < 1
        assert (cost.step_us, cost.loop_us) == (None, None)


def test_what_was_swept_keeps_its_energy_and_stays_inside(result):
    """Discrete loses discs through the thin wall; the others lose none. A pile's energy is what is left, in joules."""
    fast = costs_of(result, "fastgas 100")
    assert fast["discrete"].escaped > 0
    for kind in KINDS[1:]:
        assert (fast[kind].escaped, fast[kind].capped) == (0, 0)
        assert abs(fast[kind].change) < 1e-11  # some 10^4 impacts, each to rounding: 1e-15
    for cost in costs_of(result, "gas2d 60").values():
        assert cost.escaped == 0
        assert abs(cost.change) < 1e-12
    for cost in costs_of(result, "pile2d 30 settled").values():
        assert cost.joules > 0


def test_one_ccd_body_makes_a_discrete_world_that_sweeps():
    course = SMALL[0]
    for kind, mode, swept in (("discrete", "discrete", 0), (ONE_SWEPT, "discrete", 1), ("continuous", "continuous", 0)):
        world = course.build(kind, 3)
        assert world.settings.collision == mode
        assert np.asarray(world.bodies.dynamic.ccd).sum() == swept
        world.close()


def test_capped_impacts_are_counted_from_where_the_timing_begins(monkeypatch):
    """With a cap of one impact per body and step, fast discs reach it at once."""
    plain = Course.build

    def capped(self, kind, seed):
        world = plain(self, kind, seed)
        world.settings = world.settings.replace(max_impacts_per_step=1)
        return world

    monkeypatch.setattr(Course, "build", capped)
    course = dataclasses.replace(SMALL[1], kinds=("discrete", "continuous"))
    world = course.build("continuous", 0)
    run = bench_modes.Run(world, 20)
    whole = run.counters()["capped_impacts"]
    assert whole > 0
    assert run.capped_before == whole
    world.close()
    found = modes(2, 1, courses=[course])
    assert costs_of(found, "fastgas 100")["continuous"].capped > 0


def test_blocks_in_which_kernels_came_do_not_count(monkeypatch):
    """The first block of one kind is disturbed: it is left out for all kinds."""
    numbers = itertools.count()

    def timed(work):
        work()
        return (1000.0, False, None) if next(numbers) == 1 else (3.0, True, None)

    monkeypatch.setattr("carom.lab.studies.bench.collision_modes.timed", timed)
    course = dataclasses.replace(SMALL[0], kinds=KINDS)
    found = modes(10, 1, courses=[course])
    for cost in found.costs:  # blocks of one step
        assert cost.milliseconds.median == pytest.approx(3000.0)
        assert cost.ratio.median == pytest.approx(1.0)
    monkeypatch.setattr("carom.lab.studies.bench.collision_modes.timed", lambda work: (1.0, False, None))
    with pytest.raises(Problem, match="gas2d 60: kernels were compiled"):
        modes(2, 1, courses=[course])


def test_it_can_be_kept_and_shown(result):
    assert Modes.from_dict(json.loads(json.dumps(result.as_dict()))) == result
    for table in bench_modes.tables(result):
        assert len(table.rows) == len(result.costs)
        assert {len(row) for row in table.rows} == {len(table.headings)}
    times, quality = ({row[:2]: row for row in table.rows} for table in bench_modes.tables(result))
    assert times["gas2d 60", "event_driven"][-1] == "ratio 5, µs per impact 1.5"
    assert times["gas2d 60", "discrete"][3:5] == ("-", "-")
    assert times["pile2d 30 settled", "continuous"][6:8] == ("-", "-")
    assert quality["fastgas 100", "continuous"][-3:] == ("0", "0", "escaped 0, capped 0")
    assert quality["pile2d 30 settled", "discrete"][2].endswith(" J")
    assert "compiling" in bench_modes.remarks(result)[0]


def test_the_courses_are_told_apart_and_only_what_is_shown_is_limited():
    assert len({course.label for course in COURSES}) == len(COURSES)
    shown = {bench_modes.RATIO, bench_modes.PER_IMPACT, bench_modes.ESCAPED, bench_modes.CAPPED}
    for course in COURSES:
        assert course.kinds[0] == "discrete"
        assert set(course.limits) <= set(course.kinds)
        assert all(set(limits) <= shown for limits in course.limits.values())
        assert course.steps(1) == 1


@pytest.mark.parametrize(("scene", "bodies", "side"), [("fastgas", 100, math.sqrt(100 * math.pi)), ("bullets", 50, 50)])
def test_a_body_beyond_a_wall_on_any_side_has_escaped(scene, bodies, side):
    """The outer faces of walls 0.2 and 0.01 thick around a square."""
    world = Course(scene, bodies).build("discrete", 0)
    outer = bench_modes.outer_box(world)
    world.close()
    wall = {"fastgas": 0.2, "bullets": 0.01}[scene]
    inside, outside = -0.9 * wall, -1.1 * wall
    for value, count in ((inside, 0), (side - inside, 0), (outside, 1), (side - outside, 1)):
        assert outer.outside(np.array([[value, 5.0]])) == outer.outside(np.array([[5.0, value]])) == count


def test_the_command(monkeypatch, result, tmp_path):
    asked = []

    def measured(steps, repeats, progress):
        asked.append((steps, repeats))
        return result

    monkeypatch.setattr(bench_modes, "modes", measured)
    page = tmp_path / "page.md"
    page.write_text("<!-- studies modes -->\n<!-- end of studies modes -->\n", encoding="utf-8")
    done = CliRunner().invoke(cli, ["modes", "--steps", "7", "--repeats", "3", "--json", "--into", str(page)])
    assert done.exit_code == 0, done.output
    assert asked == [(7, 3)]
    assert Modes.from_dict(json.loads(done.stdout)) == result
    text = page.read_text(encoding="utf-8")
    assert "| fastgas 100 | event_driven |" in text
    assert "| pile2d 30 settled | continuous |" in text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["mode"], ["no command 'mode'", "did you mean 'modes'?"]),
        (["modes", "--steps", "0"], ["--steps"]),
        (["modes", "--repeats", "no"], ["--repeats", "'no'"]),
        (["modes", "--json", "--markdown"], ["exclude each other"]),
        (["modes", "--into", "nowhere.md"], ["--into nowhere.md"]),
    ],
    ids=lambda value: " ".join(value) if value and value[0].startswith("mode") else "",
)
def test_wrong_values(arguments, words):
    done = CliRunner().invoke(cli, list(arguments))
    assert done.exit_code == 2
    (line,) = done.stderr.splitlines()
    for word in words:
        assert word in line
