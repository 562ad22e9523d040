"""Times of a step: by system always, by stage and kernel inside a profile; the counts and the divisors."""

from __future__ import annotations

import json
import re
import time

import pytest
from click.testing import CliRunner
from worlds import ball, floor, make_world, run

from carom.components import RigidBody, Transform
from carom.framework import CaromError, ForceSystem
from carom.framework.compilation import kernel, log
from carom.framework.jit.tick_counter import TickClock
from carom.framework.schedule.profile_report import Stats, Totals
from carom.lab.cli.main import cli

pytestmark = pytest.mark.plain

STEPS = 5


@kernel
def pull(force):
    for i in range(len(force)):
        force[i, 0] -= 1.0


class Pull(ForceSystem):
    def add_forces(self, bodies, time):
        pull(bodies.force)


def bouncing(d=2, **settings):
    world = make_world(d, gravity=9.81, **settings)
    floor(world, restitution=0.8)
    for k in range(4):
        ball(world, (2.0 * k, 0.45 + 0.2 * k, 0.0)[:d], restitution=0.8)
    return world


def kernel_calls(world):
    """(system, kernel) -> calls per step."""
    return {(row.system, row.kernel): row.calls for row in world.stats().kernels}


@pytest.mark.compiled
def test_a_profile_counts_the_calls_of_each_stage_and_kernel_by_system():
    world = bouncing(integrator="rk4")
    world.add_system(Pull())
    run(world, 1)  # compiled; calls that compile are not counted
    with world.profile():
        run(world, STEPS)
    calls = kernel_calls(world)
    assert calls["Integration", "runge_kutta_stage"] == 4
    assert calls["ForceAccumulation", "sum_forces"] == 1 + 3  # at the start of the step, and where rk4 evaluates again
    assert calls["ForceAccumulation", "pull"] == 1
    assert calls["Integration", "pull"] == 3
    assert calls["NarrowPhase", "evaluate_pairs"] == 1
    assert calls["BroadPhase", "box_motions"] == 1
    assert "semi_implicit_euler" not in {name for _, name in calls}


@pytest.mark.compiled
def test_kernels_called_between_steps_stand_apart():
    world = bouncing()
    run(world, 1)
    world.query_sphere((0, 0), 3.0)
    with world.profile():
        run(world, STEPS)
        world.query_sphere((0, 0), 3.0)
    outside = [row for row in world.stats().kernels if row.system == ""]
    assert outside
    assert all(not row.nanoseconds for row in outside)  # a query has no body count to divide by
    assert world.stats().kernels[-len(outside) :] == tuple(outside)


@pytest.mark.compiled
def test_no_time_is_negative_when_ticks_turn_out_to_be_shorter(monkeypatch):
    """How long one is becomes known better during a profile: what was counted before it has no part in that."""
    world, rates = bouncing(), iter(1e-9 * 0.9**k for k in range(100))
    run(world, 100)
    monkeypatch.setattr(TickClock, "seconds_per_tick", property(lambda _: next(rates)))
    for _ in range(3):
        with world.profile():
            run(world, 1)
    stats = world.stats()
    assert min(row.milliseconds for row in stats.kernels) > 0.0
    assert min(stats.milliseconds.values()) >= 0.0
    assert " -" not in str(stats)


@pytest.mark.compiled
def test_means_are_over_the_steps_inside_profiles_since_the_last_reset():
    world = bouncing()
    run(world, 3)
    for steps in (2, 3):
        with world.profile():
            run(world, steps)
        run(world, 7)
    assert kernel_calls(world)["Integration", "semi_implicit_euler"] == 1
    assert (world.stats().steps, world.stats().profiled.steps) == (3 + 2 + 7 + 3 + 7, 5)
    with world.profile():
        run(world, 3)
        world.reset_stats()
        assert world.stats().kernels == ()
        run(world, 2)
    assert world.stats().profiled.steps == 2
    assert kernel_calls(world)["Integration", "semi_implicit_euler"] == 1
    world.reset_stats()
    assert world.stats().kernels == ()


@pytest.mark.compiled
def test_time_is_divided_by_what_the_counters_counted():
    world = bouncing()
    run(world, 1)
    world.reset_stats()
    with world.profile():
        run(world, STEPS)
    stats = world.stats()
    assert stats.counters["bodies"] == 4 * STEPS  # the floor does not move
    for system, units in {
        "ForceAccumulation": {"body"},
        "Integration": {"body"},
        "BroadPhase": {"body"},
        "NarrowPhase": {"body", "candidate"},
        "Response": {"body", "pair", "contact"},
        "ContactEvents": {"body", "pair", "contact"},
    }.items():
        assert set(stats.nanoseconds[system]) == units
    for name, counter in {"body": "bodies", "candidate": "candidates"}.items():
        whole = stats.nanoseconds["NarrowPhase"][name] * stats.counters[counter]
        assert whole == pytest.approx(1e6 * stats.milliseconds["NarrowPhase"] * STEPS)
    (row,) = [row for row in stats.kernels if row.kernel == "evaluate_pairs"]
    assert row.nanoseconds["candidate"] * stats.counters["candidates"] == pytest.approx(1e6 * row.milliseconds * STEPS)
    assert sum(stats.milliseconds.values()) == pytest.approx(stats.total)


def test_what_there_was_none_of_divides_nothing():
    world = make_world()
    world.create_entity(Transform((0, 0)), RigidBody())
    run(world, 2)
    assert set(world.stats().nanoseconds["NarrowPhase"]) == {"body"}
    assert world.stats().nanoseconds["Response"].keys() == {"body"}
    empty = make_world()
    run(empty, 1)
    assert empty.stats().nanoseconds["Integration"] == {}


@pytest.mark.compiled
def test_compiling_is_kept_apart(monkeypatch, tmp_path):
    monkeypatch.setenv("CAROM_CACHE_DIR", str(tmp_path))
    world = make_world()
    world.create_entity(Transform((0, 0)), RigidBody())
    run(world, 1)
    world.reset_stats()

    @kernel
    def push(force):
        for i in range(len(force)):
            force[i, 0] += 2.0

    class Push(ForceSystem):
        def add_forces(self, bodies, time):
            push(bodies.force)

    world.add_system(Push())
    waited, compiled = log.waited, len(log.compiled)
    with world.profile():
        run(world, STEPS)
    assert len(log.compiled) == compiled + 1
    stats = world.stats()
    assert stats.compile_seconds == pytest.approx(log.waited - waited)
    assert stats.compile_seconds >= log.compiled[-1][1]
    assert kernel_calls(world)["ForceAccumulation", "push"] == (STEPS - 1) / STEPS


def test_one_profile_at_a_time():
    first, second = bouncing(), bouncing()
    with first.profile():
        for world in (first, second):
            with pytest.raises(CaromError, match="one world at a time"), world.profile():
                pass
        run(first, 1)
    with second.profile():
        run(second, 2)
    assert kernel_calls(second)["Integration", "semi_implicit_euler"] == 1


def test_the_stats_print_as_a_table():
    world = bouncing()
    run(world, 1)
    with world.profile():
        run(world, STEPS)
    lines = str(world.stats()).splitlines()
    assert re.split("  +", lines[0]) == [
        "system", "ms per step", "ns per body", "ns per candidate", "ns per pair", "ns per contact",
    ]  # fmt: skip
    names = [line.split()[0] for line in lines[1:]]
    assert names.index("Integration") + 1 == names.index("keep_start")
    assert lines[-1].startswith(f"all, {STEPS + 1} steps")
    assert "nan" not in str(Stats(Totals()))


@pytest.fixture
def carom(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(cli, ["run", "billiards", "--no-pictures", *arguments])


@pytest.mark.slow
@pytest.mark.compiled
def test_the_command_s_json_adds_up(carom):
    carom("--steps", "40")  # whatever has to be compiled
    result = carom("--steps", "40", "--profile", "--json")
    report = json.loads(result.stdout)
    profile = report["profile"]
    assert 0 < profile["steps"] <= 40
    for system, mean in report["system_milliseconds"].items():
        assert sum(row["milliseconds"] for row in profile["kernels"] if row["system"] == system) <= mean * (1 + 1e-9)
    assert set(profile["nanoseconds"]) == set(report["system_milliseconds"])
    (euler,) = [row for row in profile["kernels"] if row["kernel"] == "semi_implicit_euler"]
    assert euler["calls"] == 1
    assert set(euler) == {"system", "kernel", "calls", "milliseconds", "nanoseconds"}
    assert json.loads(carom("--steps", "2", "--json").stdout)["profile"] is None


def test_ticks_are_compared_with_seconds_over_two_milliseconds():
    TickClock()  # loads the counter
    began, clock = time.perf_counter(), TickClock()
    assert clock.seconds_per_tick > 0.0
    assert time.perf_counter() - began >= TickClock.SHORTEST
