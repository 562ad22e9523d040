"""The answer of `carom trade` in words: what to paste, what it costs, what would be noticed."""

from __future__ import annotations

import dataclasses

import helpers_trade as made
import pytest

from carom.lab.measure.effects import in_words, noticed, severity
from carom.lab.measure.timing import Spread
from carom.lab.trading.answer import answer, clearly_worse, recommended
from carom.lab.trading.records import Cell, ErrorBar, Point

OWN = Cell(1 / 60)


def point(dt: float, microseconds: float, **effects: float) -> Point:
    """One setting with the cost of a frame and its effects; bodies are 1 m."""
    error = ErrorBar.of([effects.get("place", 0.0)])
    return Point(
        Cell(dt), 1, {"position": error, "energy": error}, {}, {}, 1e6 / dt, Spread.of([0.06 * microseconds]),
        {"size": 1.0, **effects}, f"Settings(dt={dt:.4g})",
    )  # fmt: skip


@pytest.fixture
def case():
    found = made.smooth(against=False)
    curve = found.curves[0]
    curve.points = [
        point(1 / 15, 10.0, place=0.3, body=7.0), point(1 / 30, 20.0, place=0.009), point(1 / 60, 40.0, place=0.008),
        point(1 / 120, 80.0, place=0.001),
    ]  # fmt: skip
    return dataclasses.replace(found, curves=[curve], own=OWN, repeats=1)


def test_the_cheapest_of_which_nothing_is_noticed_and_the_next_choice(case):
    case.inputs = {repr(1 / 60): {"size": 1.0}, repr(1 / 30): {"place": 0.08, "size": 1.0}}
    lines = answer(case)
    assert lines == [
        "orbit: use Settings(dt=0.03333), 0.5 times the cost of Settings(dt=0.01667) now; nothing is noticed with "
        "either",
        "  cost     20 us per frame of 1/60 s on this machine, 0.12 % of it",
        "  error    9 mm: how far a body ends from where it should after 10 s; noticed: nothing",
        "  cheaper  Settings(dt=0.06667): 0.5 times the cost; noticed: entity 7 ends 30 cm from where it should",
        "  inputs   read once a step, which is in no error above: 16.7 ms now: nothing is noticed; 33.3 ms: a body "
        "ends 8 cm from where it should",
    ]
    assert answer(case) == lines


def with_points(case, *points):
    case.curves[0].points = list(points)
    return recommended(case), answer(case)[0]


def test_the_scenes_own_settings_stay_if_others_save_little(case):
    """Times scatter, counts of work do not: a quarter more is the same cost."""
    own, other = point(1 / 60, 1.0, place=0.0), point(1 / 72, 99.0, place=0.0)
    other.work = 0.81 * own.work
    assert with_points(case, other, own) == (own, "orbit: use Settings(dt=0.01667) (as it has now)")
    other.work = 0.79 * own.work
    assert recommended(case) is other
    own.milliseconds, other.milliseconds = Spread.of([1.0]), Spread.of([0.9])  # taken beside other runs
    assert recommended(case) is other
    own.alone = other.alone = True
    assert with_points(case, other, own) == (own, "orbit: use Settings(dt=0.01667) (as it has now)")
    other.milliseconds = Spread.of([0.6])
    assert recommended(case) is other


def test_a_dearer_choice_needs_a_gain_that_a_player_sees(case):
    own, finer = point(1 / 60, 20.0, place=0.014), point(1 / 120, 40.0, place=0.005)
    assert recommended(case) is not None
    assert with_points(case, own, finer)[0] is own  # 9 mm of a body of 1 m
    own = point(1 / 60, 20.0, place=0.023, body=4.0)
    chosen, line = with_points(case, own, finer)
    assert chosen is finer
    assert line == (
        "orbit: use Settings(dt=0.008333), 2 times the cost of Settings(dt=0.01667) now, because a player sees the "
        "difference: with that entity 4 ends 2.3 cm from where it should"
    )
    own.failures = {"tunnelled": 1}
    assert with_points(case, own, finer)[1].endswith("now, which tunnelled")


def test_where_something_is_noticed_with_all_the_least_is_best(case):
    points = [point(1 / 30, 1.0, place=9.0), point(1 / 60, 2.0, place=2.2), point(1 / 120, 9.0, place=2.0)]
    assert with_points(case, *points)[0].cell.dt == 1 / 60


def test_scenes_of_which_nothing_is_known(case):
    assert answer(made.refused()) == [
        "my_scene.py: not measured: there is no wall whose pressure could be measured"
    ]
    case.curves[0].points = [dataclasses.replace(point(1 / 60, 1.0), failures={"tunnelled": 1})]
    assert answer(case) == ["orbit: nothing that was tried can be used: tunnelled"]


@pytest.mark.parametrize(("effects", "words"), [
    ({"place": 0.2, "body": 3.0}, ["entity 3 ends 20 cm from where it should"]),
    ({"apex": -0.02}, ["the highest point is 2 cm lower"]),
    ({"contact": 0.0123}, ["the first contact is 12.3 ms late"]),
    ({"impacts": -2.0}, ["2 impacts fewer"]),
    ({"sink": 0.5}, ["bodies sink 50 cm into each other"]),
    ({"jitter": 0.05}, ["what rests still moves at 5 cm per second"]),
    ({"energy": -0.03}, ["the energy falls by 3 % a minute"]),
    ({"place": 0.01, "apex": 0.01, "contact": 0.01, "sink": 0.01, "energy": 0.01}, []),
    ({"place": 0.1, "size": 20.0}, []),
])  # fmt: skip
def test_what_is_noticed_is_told(effects, words):
    assert in_words(effects) == words
    assert bool(noticed(effects)) == (severity(effects) > 1) == bool(words)


def test_what_is_clearly_worse_at_hardly_less_cost_is_not_run_again():
    points = [
        point(1 / 30, 10.0, place=0.005), point(1 / 60, 20.0, place=0.04), point(1 / 90, 20.0, place=0.06),
        point(1 / 20, 7.5, place=5.0), point(1 / 25, 9.5, place=5.0),
        dataclasses.replace(point(1 / 120, 30.0), failures={"tunnelled": 1}),
        dataclasses.replace(point(1 / 15, 4.0), failures={"tunnelled": 1}),
    ]  # fmt: skip
    assert {round(1 / cell.dt) for cell in clearly_worse(points)} == {25, 60, 90, 120}
