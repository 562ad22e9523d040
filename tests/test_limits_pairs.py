"""The axes in pairs: random scenes that cross the axes; a seed and a number draw the same scene again."""

from __future__ import annotations

import dataclasses
import json
import math

import click
import numpy as np
import pytest
from click.testing import CliRunner

from carom.lab.cli.group import Commands
from carom.lab.studies.limits.command import limits_command
from carom.lab.studies.limits.pairs.axes import AXES, KINDS, NAMES, PAIRS, ROUND, Draw
from carom.lab.studies.limits.pairs.scenes import Outcome, build, played
from carom.lab.studies.limits.pairs.sweep import Batch, PairLimits, pair_limits, play_batch
from carom.lab.studies.limits.records import MODES


@click.group(cls=Commands)
def carom():
    """The command as a subcommand of ``carom``."""


carom.add_command(limits_command)


def invoke(*arguments):
    return CliRunner().invoke(carom, ["limits", *arguments])


def but_time(outcome):
    return dataclasses.replace(outcome, slowest=0.0)


# -- what is drawn -------------------------------------------------------------------------------


def test_a_round_crosses_every_pair_in_every_mode():
    draws = [Draw.of(3, number) for number in range(4 * ROUND)]
    for mode in MODES:
        found = {tuple(sorted(draw.crossed)) for draw in draws if draw.mode == mode}
        assert len(found) == len(PAIRS) == math.comb(len(AXES), 2)
    assert {draw.kind for draw in draws} == set(KINDS)
    for draw in draws:
        for name, place in draw.crossed.items():
            low, high = AXES[NAMES.index(name)].bins[place]
            assert low * (1 - 1e-12) <= draw.values[name] <= high * (1 + 1e-12)
        assert draw.values["height"] in range(1, 6)
        if "height" in draw.crossed:
            assert draw.kind == "stack"
        if draw.dimensions == 3:
            assert draw.shape != "polygon"
            assert draw.floor in ("box", "half_space")


def test_a_scene_is_drawn_from_its_seed_and_number_alone():
    assert Draw.of(5, 1234) == Draw.of(5, 1234)
    assert Draw.of(5, 1234) != Draw.of(6, 1234)
    draw = next(draw for draw in map(Draw.of, [0] * ROUND, range(ROUND)) if draw.kind == "room")
    one, other = build(draw), build(draw)
    np.testing.assert_array_equal(one.world.bodies.position, other.world.bodies.position)
    assert one.world.state_hash() == other.world.state_hash()
    assert 10 <= len(one.rows) <= 30
    one.world.close()
    other.world.close()


# -- what is noted -------------------------------------------------------------------------------


def test_scenes_are_reproduced_alone(tmp_path):
    """In any order and process: the same outcome but for the time."""
    result = pair_limits(6, seed=2, workers=1)
    for outcome in reversed(result.outcomes):
        assert but_time(played(Draw.of(2, outcome.number))) == but_time(outcome)
    assert PairLimits.from_dict(json.loads(json.dumps(result.as_dict(), allow_nan=False))) == result
    assert [outcome.number for outcome in play_batch(Batch(2, (4, 1)))] == [4, 1]
    with pytest.raises(ValueError, match="scenes must be a whole number from 1"):
        pair_limits(0)


def shaped(kind, spoil):
    """The outcome of a plain continuous scene of that kind, spoilt before its first step."""
    values = dict.fromkeys(NAMES, 0.0) | {"gravity": 2.7e-3, "mass": 1.0, "size": 1.0, "density": 1.0, "height": 3.0}
    values["restitution"] = 1.0
    draw = Draw(0, 0, MODES[1], "velocity_verlet", 2, kind, "ball", "box", 1.0, 1.0, {"mass": 0, "size": 0}, values)
    from carom.lab.studies.limits.pairs import scenes

    scene, outcome = build(draw), Outcome(0)
    spoil(scene)
    scenes._play(scene, outcome)
    scene.world.close()
    return outcome


def test_failures_are_seen():
    def swapped(scene):
        y = scene.world.bodies.position[scene.rows, 1]
        scene.world.bodies.position[scene.rows, 1] = y[[1, 0, 2]]

    def dropped(scene):
        scene.world.bodies.position[scene.rows[0], 1] = -50.0

    def poisoned(scene):
        scene.world.bodies.linear_velocity[scene.rows[0], 0] = math.nan

    def thrown(scene):
        scene.world.bodies.position[scene.rows[0], 0] = 1e3

    assert shaped("stack", lambda scene: None).failures == []
    assert shaped("room", lambda scene: None).failures == []
    assert "order" in shaped("stack", swapped).failures
    assert "lost" in shaped("stack", dropped).failures
    assert "not finite" in shaped("stack", poisoned).failures
    found = shaped("room", thrown)
    assert (found.failures, found.lost, found.broken, found.gain) == (["lost"], 1, 1, None)
    assert Outcome(1, gain=0.02).failures == ["energy"]
    assert Outcome(1, refused="too many").failures == ["refused"]


# -- the command ---------------------------------------------------------------------------------


def test_the_command_plays_one_scene():
    first, again = invoke("--play", "36", "--seed", "7"), invoke("--play", "36", "--seed", "7", "--json")
    assert first.exit_code == again.exit_code == 0, first.output
    assert first.stdout.startswith("scene 36 of seed 7: ")
    assert "settings: continuous, " in first.stdout
    found = json.loads(again.stdout)
    assert Draw(**found["scene"]) == Draw.of(7, 36)
    assert but_time(Outcome(**found["outcome"])) == but_time(played(Draw.of(7, 36)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--scenes", "3"], "--scenes needs --pairs"),
        (["--workers", "3"], "--workers needs --pairs"),
        (["--pairs", "--axes", "mass"], "--axes does not go with --pairs or --play"),
        (["--pairs", "--long"], "--long does not go with --pairs or --play"),
        (["--pairs", "--quick", "--scenes", "3"], "--quick and --scenes exclude each other"),
        (["--play", "3", "--scenes", "3"], "--scenes does not go with --play"),
        (["--pairs", "--seed", "x"], "--seed takes a whole number"),
    ],
)
def test_the_command_refuses_in_one_line(arguments, message):
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert message in result.output
    assert len(result.output.strip().splitlines()) == 1


@pytest.mark.parametrize(("number", "why"), [
    (2738, "a falling stack, whose rigid contacts also push against each other"),
    (7634, "a box that passes beyond a corner of its room in the step in which it touches the wall"),
    (3602, "a grain that falls through a thin wall before something strikes it"),
])  # fmt: skip
def test_scenes_that_went_wrong(number, why):
    """Within the valid range, and wrong before their cause was found."""
    draw = Draw.of(0, number)
    assert played(draw).failures == [], why
