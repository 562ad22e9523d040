"""`carom tune` and `tune()`: the cheapest settings that keep an error limit, or why there are none.

Each expected result is known from a closed form or from the text of the interface.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from pathlib import Path

import pytest
from click.testing import CliRunner
from helpers_trade_scenes import BALL, CROWD, REST, SPRING, scene_file

import carom.lab
from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import CaromError, Settings, World
from carom.lab import NothingMeetsError, Only, search, tune
from carom.lab.cli.loading import load
from carom.lab.cli.main import cli
from carom.lab.cli.usage_errors import Problem
from carom.lab.jobs import runs
from carom.lab.jobs.tasks import perform
from carom.lab.tuning import report
from carom.lab.tuning import search as tuning_search
from carom.lab.tuning.check import check
from carom.lab.tuning.search import Tuning
from carom.plugins import Physics

pytestmark = [pytest.mark.slow, pytest.mark.early]  # many runs: half a minute or more together

SPEED, GRAVITY = 240.0, 450.0  # pixels/s and pixels/s^2: those of the scene jump, apex 64 pixels
TWO_STEPS = (1 / 30, 1 / 60)


def evaluated(line: str) -> Settings:
    return eval(line, {"Settings": Settings})


@pytest.fixture(scope="module")
def jump() -> Tuning:
    return search("jump", 0.1, "apex", absolute=True, workers=1, repeats=16)


@pytest.fixture(scope="module")
def spring() -> Tuning:
    return search("spring", 1e-2, workers=1, steps=(1 / 15, 1 / 30, 1 / 60, 1 / 120), repeats=2)


# -- what is found ------------------------------------------------------------------------------------------------


def test_the_step_for_the_jump_arc_is_that_of_the_closed_form(jump):
    """Velocity Verlet is exact at steps, so the apex is missed by g dt^2 / 8 at most: 0.1 px allows 0.0422 s."""
    largest = math.sqrt(8 * 0.1 / GRAVITY)
    assert jump.settings.integrator == "velocity_verlet"
    assert 1 / 30 < jump.settings.dt <= largest
    assert jump.target * jump.scale == pytest.approx(0.1)
    assert jump.scale == pytest.approx(64.0)
    assert jump.error <= jump.target
    assert jump.margin == pytest.approx(jump.target / jump.error)
    assert jump.margin >= 1


def test_all_repeats_have_to_keep_the_target(jump):
    """At 1/15 s the first start phase happens to meet the apex exactly, others miss it by up to 0.25 px."""
    at_largest = [t for t in jump.trials if t.cell.integrator == "velocity_verlet" and t.cell.dt == 1 / 15]
    assert [(t.repeats, t.met) for t in at_largest] == [(1, True), (2, False)]  # the second ended it
    assert at_largest[0].error < 1e-12
    assert at_largest[1].error * 64 == pytest.approx(GRAVITY / 15**2 / 8, rel=0.01)


def test_nothing_more_expensive_than_needed_is_run(jump):
    assert jump.choice is not None
    assert len(jump.trials) < 3 * 8 / 2  # the whole grid: three methods, eight steps, all of them 16 times
    assert max(trial.work for trial in jump.trials) < 4 * jump.choice.work


def test_what_misses_in_one_run_is_run_no_further(monkeypatch):
    """Only what holds has all repeats; the finer step that fails after it has been looked at once, too."""
    done = []
    monkeypatch.setattr(runs, "perform", lambda task: done.append(task) or perform(task))
    found = search("spring", 1e-2, workers=1, steps=(1 / 15, 1 / 30), repeats=16)
    assert found.choice is not None
    ran = Counter(task.cell for task in done if not task.reference)
    assert ran == {trial.cell: trial.repeats for trial in sorted(found.trials, key=lambda trial: trial.repeats)}
    assert {trial.repeats for trial in found.trials if trial.met and trial.repeats > 1} == {16}
    assert {trial.repeats for trial in found.trials if not trial.met} == {1}


def test_the_choice_on_the_spring(spring):
    """Runge-Kutta 4 lags by (w dt)^4 / 120 of the angle w t: at 1/15 s by 8e-3 of 32.7, which is a relative 3e-3."""
    lag = (2 * math.pi / 15) ** 4 / 120 * 2 * math.pi * 5.2 / 2
    assert lag < 1e-2
    assert spring.settings == Settings(dt=1 / 15, integrator="rk4")
    assert spring.error < 2 * lag
    assert spring.runner_up is not None
    assert spring.runner_up.cell.integrator != "rk4"
    assert spring.runner_up.work > spring.choice.work
    assert spring.runner_up.errors["position"].high <= 1e-2


def test_the_line_to_paste_gives_the_settings(jump, spring):
    for found in (jump, spring):
        assert evaluated(found.line) == found.settings


def test_dials_that_are_not_searched_stay_in_the_line():
    def falling(settings, seed=0):
        """A ball falls without contacts; its world sets a slop."""
        settings = settings or Settings(dt=1 / 50, slop=0.02, max_steps_per_advance=3)
        world = World(Physics(dimensions=2, gravity=(0.0, -10.0)), settings=settings)
        world.create_entity(Transform((0.0, 5.0)), RigidBody(), SphereCollider(0.5))
        return world

    found = search(falling, 1e-6, seconds=1.0, steps=TWO_STEPS, repeats=2, workers=1)
    assert found.settings == Settings(
        dt=found.settings.dt, integrator="velocity_verlet", slop=0.02, max_steps_per_advance=3
    )
    assert evaluated(found.line) == found.settings


def test_no_step_is_larger_than_the_largest_that_was_allowed():
    """An error that any step meets: the largest step, and not a larger one."""
    found = search("spring", 5.0, steps=TWO_STEPS, seconds=1.0, repeats=1, workers=1)
    assert found.settings.dt == 1 / 30
    assert all(trial.cell.dt <= 1 / 30 for trial in found.trials)


def test_what_rests_is_tuned_by_its_overlap(tmp_path):
    found = search(scene_file(tmp_path, REST), 5e-3, steps=TWO_STEPS, workers=1)
    assert found.norm == "overlap"
    assert found.error <= 5e-3


def test_tune_returns_the_settings_that_search_finds_and_again_the_same(spring):
    options = {"steps": (1 / 15, 1 / 30, 1 / 60, 1 / 120), "repeats": 2, "workers": 1}
    again = search("spring", 1e-2, **options)
    assert (again.trials, again.line) == (spring.trials, spring.line)
    assert again.choice.errors == spring.choice.errors
    assert tune("spring", 1e-2, **options) == spring.settings


def test_a_function_that_no_other_process_can_import_is_tuned():
    """The jump arc, made by a closure: in metres, so the same error is another length."""
    speed = SPEED / 16

    def hero(settings, seed=0, gravity=GRAVITY / 16):
        """A jump in metres."""
        world = World(Physics(dimensions=2, gravity=(0.0, -gravity)), settings=settings)
        world.create_entity(Transform((0.0, 0.0)), RigidBody(linear_velocity=(1.0, speed)))
        return world

    found = search(hero, 0.1 / 64, "apex", seconds=1.0, steps=(1 / 15, *TWO_STEPS), repeats=16, workers=2)
    assert (found.scene, found.settings.integrator) == ("hero", "velocity_verlet")
    assert found.scale == pytest.approx(4.0, rel=1e-6)
    assert 1 / 30 < found.settings.dt <= math.sqrt(8 * 0.1 / GRAVITY)


def test_the_same_search_finds_the_same_with_one_worker_or_two(tmp_path):
    """The own references of this file are just long enough for workers."""
    mine = scene_file(tmp_path, SPRING.format(stiffness=15.0))
    only = Only(integrators=("velocity_verlet",))
    first, second = (search(mine, 1e-2, seconds=0.7, repeats=2, workers=workers, only=only) for workers in (1, 2))
    assert second.trials == first.trials
    assert second.choice.errors == first.choice.errors
    assert second.line == first.line
    assert second.reference == first.reference


# -- what cannot be found -----------------------------------------------------------------------------------------


def test_before_there_are_references_the_own_settings_are_told_of(tmp_path, monkeypatch):
    """Time is up as soon as references would run."""

    def no_time(*_):
        raise runs.OutOfTimeError

    monkeypatch.setattr(tuning_search, "exact_enough", no_time)
    file, shown = scene_file(tmp_path, BALL), []
    kept = search(file, 10.0, budget=30.0, workers=1, show=shown.append)
    assert shown == [kept]
    assert kept.rough
    assert kept.choice is not None
    assert kept.settings == Settings()
    assert "rough, against a first run" in report.answer(kept)[-1]
    missed = search(file, 1e-9, budget=30.0, workers=1)
    assert missed.choice is None
    assert "its own settings do not keep the position error" in report.answer(missed)[0]


def test_a_search_that_has_tried_nothing_yet_does_not_replace_a_rough_answer(tmp_path, monkeypatch):
    monkeypatch.setattr(tuning_search._Search, "_cheapest_two", lambda searching, _: searching.runs._stop(""))
    kept = search(scene_file(tmp_path, BALL), 10.0, budget=30.0, workers=1)
    assert kept.rough
    assert kept.choice is not None
    assert kept.stopped == runs.OUT_OF_TIME


def test_when_nothing_keeps_the_error_the_best_is_named():
    options = {"steps": (1 / 15,), "repeats": 1, "workers": 1, "only": Only(integrators=("explicit_euler",))}
    found = search("spring", 1e-9, **options)
    assert found.choice is None
    assert found.runner_up is None
    assert math.isinf(found.error)
    assert not any(trial.met for trial in found.trials)
    best = min(trial.error for trial in found.trials)
    assert "spring: no settings keep the position error below 1e-09" in found.why_not
    assert f"{best:.3g}" in found.why_not
    assert 'integrator="explicit_euler"' in found.why_not
    for raises in (lambda: found.settings, lambda: found.line, lambda: tune("spring", 1e-9, **options)):
        with pytest.raises(NothingMeetsError, match="no settings keep"):
            raises()
    assert issubclass(NothingMeetsError, (CaromError, ValueError))
    with pytest.raises(NothingMeetsError):
        check(found, "spring")


def test_a_target_below_what_the_references_know_is_refused(tmp_path):
    with pytest.raises(Problem, match=r"mine\.py: no reference is exact enough for a position error of 1e-13"):
        search(scene_file(tmp_path, SPRING.format(stiffness=15.0)), 1e-13, steps=(1 / 15,), seconds=2.0, workers=1)


def test_a_statistic_that_is_too_noisy_for_the_target_is_refused():
    """16 discs for 10 s: a single run's pressure is known to some 5 %, that of 80 runs to half a per cent."""
    options = {"n": 16}
    with pytest.raises(Problem, match=r"thermal_gas.*pressure.*(larger error|longer runs)"):
        search("thermal_gas", 1e-4, seconds=10.0, options=options, workers=1)


def test_chaos_is_not_tuned_by_places(tmp_path):
    with pytest.raises(Problem, match=r"mine\.py is chaotic.*position would measure chance"):
        tune(scene_file(tmp_path, CROWD), 1e-3, "position", workers=1)


@pytest.mark.parametrize(("arguments", "options", "words"), [
    (("spring", 0.0), {}, "max_error"),
    (("spring", -1e-3), {}, "max_error"),
    (("spring", math.nan), {}, "max_error"),
    (("spring", math.inf), {}, "max_error"),
    (("spring", "1e-3"), {}, "max_error"),
    (("spring", True), {}, "max_error"),
    (("sprin", 1e-3), {}, "did you mean 'spring'"),
    (("spring", 1e-3, "positon"), {}, "did you mean 'position'"),
    (("spring", 1e-3), {"seconds": 0.0}, "seconds"),
    (("spring", 1e-3), {"repeats": 0}, "repeats"),
    (("spring", 1e-3), {"steps": (0.0,)}, "steps"),
    (("spring", 1e-3), {"workers": 0}, "workers"),
    (("spring", 1e-3), {"options": {"mass": 2}}, "mass"),
    (("spring", 1e-3), {"only": Only(integrators=("rk5",))}, "did you mean 'rk4'"),
    (("spring", 1e-3), {"only": Only(collisions=("discreet",))}, "discreet"),
])  # fmt: skip
def test_wrong_arguments_are_named(arguments, options, words):
    with pytest.raises((ValueError, Problem), match=words):
        search(*arguments, **options)


def test_the_names_of_the_laboratory():
    assert {"tune", "search", "check", "Tuning", "NothingMeetsError"} <= set(carom.lab.__all__)
    assert carom.lab.Tuning is Tuning
    assert carom.lab.check is check


# -- other scenes -------------------------------------------------------------------------------------------------


def hero_with(speed: float, gravity: float):
    """A user's build function."""

    def build(settings, seed=0):
        world = World(Physics(dimensions=2, gravity=(0.0, -gravity)), settings=settings)
        world.create_entity(Transform((0.0, 0.0)), RigidBody(linear_velocity=(1.0, speed)))
        return world

    return build


def test_the_error_on_another_jump_is_that_of_the_closed_form(jump):
    """g dt^2 / 8 over v^2 / 2g, at the worst of 16 start phases; the promise of 0.1 px is relative to 64 px, or 0.1."""
    speed, gravity, dt = 12.0, 30.0, jump.settings.dt
    found = check(jump, hero_with(speed, gravity))
    assert found.scale == pytest.approx(speed**2 / (2 * gravity), rel=1e-4)  # its reference samples it at steps too
    assert (found.promise, found.seconds) == (jump.target, jump.seconds)
    worst = (gravity * dt / speed) ** 2 / 4
    assert found.error == pytest.approx(worst, rel=0.2)
    assert found.error <= worst * (1 + 1e-4)
    assert found.times == pytest.approx(found.error / found.promise)
    in_metres = check(jump, hero_with(speed, gravity), absolute=True)
    assert in_metres.promise * in_metres.scale == pytest.approx(0.1)
    assert in_metres.error == pytest.approx(found.error)


def test_a_promise_that_is_broken_says_so(jump):
    """Half the speed of rise in a quarter of the time: (g dt / v)^2 grows 16 times."""
    found = check(jump, hero_with(12.0, 90.0))
    assert found.times > 2
    assert not found.tolerated
    kept = check(jump, hero_with(12.0, 20.0))
    assert kept.times <= 1
    assert kept.tolerated


# -- the command --------------------------------------------------------------------------------------------------


@pytest.fixture
def carom_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def command(*arguments: str):
        return CliRunner().invoke(cli, [*arguments, "--workers", "1"])

    return command


SHORT = ("--dt", "1/30,1/60,1/120", "--repeats", "2", "--thorough")


def test_a_newcomers_file_is_measured_and_tuned_in_two_commands(tmp_path, carom_command):
    few = ("--dt", "1/30,1/60", "--repeats", "2", "--thorough")
    scene_file(tmp_path, BALL, "own.py")
    measured = carom_command("trade", "own.py", *few, "--no-timing", "--json")
    assert measured.exit_code == 0, measured.output
    [case] = json.loads(measured.stdout)["cases"]
    assert (case["scene"], case["kind"]) == ("own.py", "impacts")
    tuned = carom_command("tune", "own.py", "--max-error", "0.001", *few)
    assert tuned.exit_code == 0, tuned.output
    settings = evaluated(tuned.stdout.splitlines()[-1])
    assert settings.dt == 1 / 30
    world = load("own.py").function(settings)  # 1 m above the ground, no loss: impacts at sqrt(0.2) s, 3 sqrt(0.2) s
    for _ in range(51):
        world.step()
    since_apex = 1.7 - 4 * math.sqrt(0.2)
    assert world.bodies.dynamic.position[0, 1] == pytest.approx(1.25 - 5 * since_apex**2, abs=1e-3 * 3.0 * 1.7)


def test_what_is_printed(carom_command):
    done = carom_command("tune", "jump", "--max-error", "0.1", "--absolute", "--norm", "apex", "--repeats", "16")
    assert re.match(r"after \d+ s: jump: use Settings\(", done.stdout)
    assert done.exit_code == 0, done.output
    words = " ".join(done.stdout.split())
    for told in (
        "jump: what was tried, in this order", "misses, 80 times", "holds", "balanced", "carom tune jump",
        "reference: closed form: the parabola", "0.100 in the scene's units", "in 16 start phases",
        "3 methods to choose from", "no other method holds within 4 times the work", "of target",
        "measured on jump over 1 s and nowhere else",
    ):  # fmt: skip
        assert told in words
    settings = evaluated(done.stdout.splitlines()[-1])
    assert settings.integrator == "velocity_verlet"


def test_json_has_it_all(carom_command):
    done = carom_command("tune", "spring", "--max-error", "0.01", *SHORT, "--json")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert evaluated(found["line"]) == Settings(**found["settings"])
    assert found["error"] <= found["target"] == 0.01
    assert found["margin"] == pytest.approx(found["target"] / found["error"])
    assert found["choice"]["errors"]["position"]["high"] == found["error"]
    assert found["balanced"]["cell"]["integrator"] == "semi_implicit_euler"
    assert found["balanced"]["work"] > 0
    assert {"cell", "error", "work", "repeats", "met", "failure"} == set(found["trials"][0])
    assert found["why_not"] == ""


def test_nothing_that_meets_is_exit_code_1(carom_command):
    arguments = ("tune", "spring", "--max-error", "1e-9", "--dt", "1/15", "--repeats", "1")
    done = carom_command(*arguments, "--integrators", "explicit_euler")
    assert done.exit_code == 1
    assert "no settings keep the position error below 1e-09" in " ".join(done.stdout.split())
    done = carom_command(*arguments, "--integrators", "explicit_euler", "--json")
    assert done.exit_code == 1
    found = json.loads(done.stdout)
    assert (found["choice"], found["line"], found["settings"]) == (None, None, None)
    assert "no settings keep" in found["why_not"]


FAR = '''
seconds = 1.0
def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0.0, -90.0)), settings=settings)
    world.create_entity(Transform((0.0, 0.0)), RigidBody(linear_velocity=(1.0, 12.0)))
    return world
'''


STILL = '''
def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0.0, -10.0)), settings=settings)
    world.create_entity(Transform((0.0, -1.0)), AABBCollider((10.0, 1.0)))
    return world
'''


def test_held_out_scenes_are_checked(tmp_path, carom_command):
    scene_file(tmp_path, FAR, "far.py")
    scene_file(tmp_path, STILL, "still.py")
    wanted = ("tune", "jump", "--max-error", "0.001", "--norm", "apex", *SHORT)
    arguments = (*wanted, "--check", "jump", "--check", "far.py")
    done = carom_command(*arguments)
    assert done.exit_code == 0, done.output
    words = " ".join(done.stdout.split())
    assert "on scenes that it was not tuned on" in words
    assert "far.py: THE PROMISE IS BROKEN: apex" in words
    assert "jump: THE PROMISE IS BROKEN" not in words
    evaluated(done.stdout.splitlines()[-1])
    done = carom_command(*arguments, "--check", "still.py", "--json")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    same, far, still = found["checks"]
    assert (same["scene"], same["tolerated"], far["tolerated"]) == ("jump", True, False)
    assert same["times"] == pytest.approx(found["error"] / found["target"])
    assert "no body that moves" in still["refused"]
    assert (still["error"], still["times"], still["tolerated"]) == (None, None, False)


def test_finished_runs_are_taken_over(monkeypatch, carom_command):
    arguments = ("tune", "spring", "--max-error", "0.01", *SHORT)
    first = carom_command(*arguments)
    assert first.exit_code == 0, first.output
    monkeypatch.setattr(runs, "perform", None)  # no task runs
    assert carom_command(*arguments).stdout == first.stdout


@pytest.mark.parametrize(("arguments", "words"), [
    (("sprin",), "did you mean 'spring'"),
    (("spring",), "--max-error is missing: how large may the error be?"),
    (("spring", "--max-error", "0"), "--max-error takes a number above 0, not 0"),
    (("spring", "--max-error", "few"), "'few' is not a valid float"),
    (("spring", "--norm", "positon"), "did you mean 'position'"),
    (("spring", "--norm", "position", "--norm", "energy"), "one error"),
    (("spring", "--integrators", "rk5"), "did you mean 'rk4'"),
    (("spring", "--check", "stak"), "did you mean 'stack'"),
    (("spring", "--json", "--markdown"), "exclude each other"),
])  # fmt: skip
def test_wrong_words_are_answered_in_one_line(carom_command, arguments, words):
    done = carom_command("tune", *arguments)
    assert done.exit_code == 2
    assert words in done.stderr
    assert done.stderr.strip().splitlines()[-1].startswith("carom: ")


def test_the_page_has_every_option():
    text = (Path(__file__).resolve().parents[2] / "docs" / "tune.md").read_text(encoding="utf-8")
    options = {option for parameter in cli.commands["tune"].params for option in parameter.opts}
    shown = set(re.findall(r"^\| `(--[a-z-]+)", text, re.MULTILINE))
    assert shown == {option for option in options if option.startswith("--")} - {"--help"}
