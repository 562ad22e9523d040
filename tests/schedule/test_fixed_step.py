"""The fixed step with a variable frame rate, taken in both ways."""

from __future__ import annotations

import math
from fractions import Fraction

import esper
import numpy as np
import pytest
from helpers_motion import FRAME_RATES, Oscillator, SpringAndDrag
from helpers_steps import both_ways  # noqa: F401  every test with each
from worlds import METHODS, ball, floor, make_world

from carom.components import RigidBody, Transform
from carom.framework import CaromError, Phase, StepError, System, World
from carom.plugins.capsule import CapsuleCollider


def busy_world(**settings):
    """Springs, damping, a bouncing ball on a floor, an external force."""
    world = make_world(gravity=9.81, **settings)
    floor(world, restitution=0.5)
    ball(world, (0.0, 2.0), (0.3, 0.0), restitution=0.7)
    ball(world, (0.2, 4.0), (-0.1, 0.0), restitution=0.2)
    world.create_entity(Transform((5, 5)), RigidBody(2.0, (1, 0), linear_damping=0.3), Oscillator(30.0, 0.1))
    world.create_entity(Transform((-5, 5)), RigidBody(kind="kinematic", linear_velocity=(0.1, 0.2)))
    world.add_system(SpringAndDrag())
    return world


def frames_of(name):
    """One second and more of frames, by rate or irregular."""
    if name != "irregular":
        return [1 / name] * (name + 1)
    rng = np.random.default_rng(3)
    return [*rng.exponential(1 / 80, 100), 0.0, 0.1, 1e-9]


@pytest.fixture(scope="module")
def hashes_by_step():
    """State hashes of 100 single steps, per method."""
    known = {}

    def of(method):
        if method not in known:
            world = busy_world(integrator=method)
            known[method] = [world.state_hash()]
            for _ in range(100):
                world.step()
                known[method].append(world.state_hash())
        return known[method]

    return of


@pytest.mark.parametrize(
    ("method", "rate"),
    [*(("semi_implicit_euler", rate) for rate in FRAME_RATES), *((method, "irregular") for method in METHODS)],
)
def test_frames_of_any_length_give_the_same_bits_per_step(hashes_by_step, method, rate):
    """B1's "same arc bit for bit", for a whole scene: the state depends on the step's number alone."""
    expected = hashes_by_step(method)
    world = busy_world(integrator=method)
    seen = 0
    for frame in frames_of(rate):
        before = world.step_count
        assert world.advance(frame) == world.step_count - before
        assert world.state_hash() == expected[world.step_count]
        seen = max(seen, world.step_count)
    assert seen >= 55
    assert len(set(expected)) == len(expected)


@pytest.mark.parametrize("rate", FRAME_RATES)
def test_number_of_steps(rate):
    """After n frames exactly floor(n 60 / rate) steps, whatever the rounding of the sum of frames."""
    world = make_world()
    for n in range(1, 5 * rate + 1):
        world.advance(1 / rate)
        assert world.step_count == n * 60 // rate
        assert world.alpha == pytest.approx(float(Fraction(n * 60, rate) % 1), abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("rate", FRAME_RATES)
def test_what_is_drawn_moves_evenly(rate):
    """Constant velocity: interpolated x = v (t - dt), one step behind the frame's own time t = n / rate."""
    world = make_world()
    transform = Transform((0, 0))
    world.create_entity(transform, RigidBody(1.0, (6.0, -3.0)))
    for n in range(1, 2 * rate + 1):
        world.advance(1 / rate)
        if n / rate >= 1 / 60:
            expected = (n / rate - 1 / 60) * np.array((6.0, -3.0))
            np.testing.assert_allclose(transform.interpolated_position, expected, rtol=0, atol=1e-7)


def test_interpolation_runs_between_the_last_two_steps():
    """previous + alpha (now - previous), under forces too; drawing changes nothing."""
    world = busy_world()
    transforms = [transform for _, transform in world.get_component(Transform)]
    world.advance(3.25 / 60)
    assert world.alpha == pytest.approx(0.25, abs=1e-9)
    other = busy_world()
    for _ in range(2):
        other.step()
    before = other.bodies.position.copy()
    other.step()
    now = other.bodies.position.copy()
    for transform in transforms:
        row = world.bodies.row_of(transform.entity)
        expected = before[row] + world.alpha * (now[row] - before[row])
        np.testing.assert_array_equal(transform.interpolated_position, expected)
    assert world.state_hash() == other.state_hash()


def test_interpolation_before_the_first_step_and_before_adoption():
    world = make_world()
    loose = Transform((1, 2))
    assert loose.interpolated_position.tolist() == [1, 2]
    world.create_entity(loose, RigidBody(1.0, (60.0, 0.0)))
    world.advance(0.5 / 60)
    assert world.alpha == pytest.approx(0.5)
    assert loose.interpolated_position.tolist() == [1, 2]
    world.step()
    late = Transform((7, 7))
    world.create_entity(late, RigidBody(1.0, (60.0, 0.0)))
    world.advance(0.0)
    assert late.interpolated_position.tolist() == [7, 7]
    assert loose.interpolated_position.tolist() == [1.5, 2]


@pytest.mark.parametrize("kind", ["dynamic", "kinematic", "static"])
def test_a_teleport_restarts_interpolation(kind):
    """No drawn position lies between the old and the new one, neither at once nor after the next step."""
    world = make_world()
    transform = Transform((0, 0))
    world.create_entity(transform, RigidBody(1.0, (60.0, 0.0), kind=kind))
    world.step()
    world.advance(0.5 / 60)
    assert world.alpha == pytest.approx(0.5)
    transform.position = (1000.0, 0.0)
    assert transform.interpolated_position.tolist() == [1000.0, 0.0]
    transform.y = -5.0
    assert transform.interpolated_position.tolist() == [1000.0, -5.0]
    world.step()
    moved = 0.0 if kind == "static" else 0.5
    np.testing.assert_allclose(transform.interpolated_position, (1000.0 + moved, -5.0), rtol=1e-15)


@pytest.mark.parametrize("cap", [1, 8, 299, 300, 1000])
def test_c26_a_frame_of_five_seconds(cap):
    """C26: at most max_steps_per_advance steps; other whole steps are dropped and counted, the rest of a step stays."""
    world = make_world(max_steps_per_advance=cap)
    steps = min(cap, 300)
    assert world.advance(5.0 + 0.25 / 60) == steps
    assert world.step_count == steps
    assert world.time == steps / 60
    assert world.stats().counters["dropped_steps"] == 300 - steps
    assert world.alpha == pytest.approx(0.25, abs=1e-9)
    assert world.advance(0.75 / 60) == 1  # no backlog from the long frame
    assert world.stats().counters["dropped_steps"] == 300 - steps


@pytest.mark.parametrize("seconds", [1e9, 1e20, 1e300, 1.7e308])
def test_frames_beyond_all_measure(seconds):
    """C26: bounded work, and less than a step is left for any rounding of the sum."""
    world = make_world()
    assert world.advance(seconds) == 8
    world.time_scale = 10.0
    assert world.advance(seconds) == 80
    world.time_scale = 1.0
    assert 0.0 <= world.alpha <= 1.0
    assert world.clock.gathered < world.settings.dt
    assert world.advance(0.0) == 0
    assert world.advance(2 / 60) == 2


@pytest.mark.parametrize("seconds", [-1e-9, -1.0, math.nan, math.inf, -math.inf, "0.1", None, [0.1]])
def test_seconds_that_are_none_are_refused(seconds):
    """C11: at the call, and the time does not change."""
    world = make_world()
    world.advance(0.5 / 60)
    state = world.clock.state()
    with pytest.raises(ValueError, match="advance takes seconds"):
        world.advance(seconds)
    assert world.clock.state() == state


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.1, 0.25, 1 / 3, 1.0, 2.5, 10])
def test_slow_motion_takes_the_same_steps_less_often(hashes_by_step, scale):
    """After n frames floor(n scale 60 / rate) steps, each with the bits that it has at any scale; alpha the rest."""
    expected, world, frames = hashes_by_step("semi_implicit_euler"), busy_world(), []

    class Frames(System):
        def process(self, dt):
            frames.append(dt)

    world.add_system(Frames(), frame=True)
    world.time_scale = scale
    exact = Fraction(scale).limit_denominator(10)
    for n in range(1, min(int(100 / scale), 300) + 1):
        world.advance(1 / 60)
        assert world.step_count == n * exact // 1
        assert world.alpha == pytest.approx(float(n * exact % 1), abs=1e-7)
        assert world.state_hash() == expected[world.step_count]
    assert (set(frames), world.stats().counters["dropped_steps"]) == ({1 / 60}, 0)
    assert world.advance(50.0) == math.ceil(8 * max(1, scale))  # a frame that is too long
    before = world.step_count
    world.step()
    assert (world.step_count, world.time) == (before + 1, (before + 1) * (1 / 60))


def test_a_pause_moves_nothing_and_draws_the_same(tmp_path):
    """Pushes of paused frames wait as those of frames without a step do; the scale is in snapshots and files."""
    world = make_world()
    handle = RigidBody(1.0, (1.0, 0.0))
    world.create_entity(Transform((0, 0)), handle)
    world.advance(1.5 / 60)
    world.time_scale = 0
    kept, drawn = world.snapshot(), world.bodies.interpolated_position
    for seconds in (0.0, 1 / 60, 1e300):
        handle.apply_force((60.0, 0.0))
        assert world.advance(seconds) == 0
        np.testing.assert_array_equal(world.bodies.interpolated_position, drawn)
    world.time_scale = 1.0
    handle.apply_force((60.0, 0.0))
    assert world.advance(0.5 / 60) == 1
    assert handle.linear_velocity.tolist() == [2.0, 0.0]
    world.restore(kept)
    assert (world.time_scale, world.advance(1.0)) == (0.0, 0)
    world.save(tmp_path / "paused")
    other = World.load(tmp_path / "paused", *[type(plugin)() for plugin in world.plugins])
    assert (other.time_scale, other.alpha, other.advance(1.0)) == (0.0, world.alpha, 0)


@pytest.mark.parametrize("scale", [-0.1, 10.1, math.nan, math.inf, True, "1", None])
def test_scales_of_time_that_are_none_are_refused(scale):
    world = make_world()
    world.time_scale = 2
    with pytest.raises(ValueError, match=f"world {world.name!r}: time_scale must be a number from 0 to 10, got"):
        world.time_scale = scale
    assert world.time_scale == 2.0


def test_a_system_stops_time_from_the_next_frame_on():
    """Of this frame all steps are taken, as they were counted before."""

    class Hit(System):
        def process(self, dt):
            world.time_scale = 0.0

    world = make_world()
    world.add_system(Hit())
    assert [world.advance(3 / 60), world.advance(3 / 60)] == [3, 0]


@pytest.mark.slow
def test_replacing_other_settings_leaves_time_exact():
    """Only a new dt starts a new count; a game that changes another setting in every step has no rounding either."""
    world = make_world()
    for n in range(1, 1001):
        world.settings = world.settings.replace(substeps=1 + n % 2)
        world.step()
        assert world.time == n * (1 / 60)


def test_settings_replaced_between_steps():
    """dt and method change from the next step on; time and step_count go on."""
    world = make_world(gravity=8.0, dt=0.5, integrator="explicit_euler")
    world.create_entity(Transform((0, 0)), RigidBody())
    world.step()  # y 0, v -4
    world.settings = world.settings.replace(dt=0.25, integrator="semi_implicit_euler")
    world.step()  # v -6, y -1.5
    world.settings = world.settings.replace(dt=1.0, integrator="velocity_verlet")
    world.step()  # y -1.5 - 6 - 4, v -14
    assert world.bodies.position[0].tolist() == [0.0, -11.5]
    assert world.bodies.linear_velocity[0].tolist() == [0.0, -14.0]
    assert (world.time, world.step_count) == (1.75, 3)
    assert world.advance(2.5) == 2
    assert world.time == 3.75


def test_a_changed_step_takes_what_has_gathered():
    """Half of a step of 1 s is two of 0.25 s."""
    world = make_world(dt=1.0)
    assert world.advance(0.5) == 0
    world.settings = world.settings.replace(dt=0.25)
    assert world.advance(0.0) == 2
    assert world.alpha == 0.0


BETWEEN_STEPS = {
    "settings": lambda w: setattr(w, "settings", w.settings.replace(dt=1.0)),
    "gravity": lambda w: setattr(w, "gravity", (0, 0)),
    "step": lambda w: w.step(),
    "advance": lambda w: w.advance(1.0),
    "register": lambda w: w.register(CapsuleCollider),
    "prepare": lambda w: w.prepare(),
    "close": lambda w: w.close(),
    "a phase": lambda w: w.run(Phase.FORCES),
    "esper": lambda w: esper.process(w.settings.dt),
}


@pytest.mark.parametrize("what", BETWEEN_STEPS)
def test_what_belongs_between_steps_is_refused_inside_one(what):
    """In a step and in a phase that is run alone; the clock is not affected."""
    refused = []

    class Meddler(System):
        def process(self, dt):
            before = world.clock.state()
            with pytest.raises(CaromError, match=r"inside|between steps"):
                BETWEEN_STEPS[what](world)
            assert world.clock.state() == before
            refused.append(what)

    world = make_world()
    world.add_system(Meddler())
    world.step()
    with world:
        esper.process(world.settings.dt)
    world.run(Phase.END)
    assert len(refused) == 3
    assert (world.step_count, world.time, world.alpha) == (2, 2 / 60, 0.0)
    assert world.stats().counters["dropped_steps"] == 0


def test_frames_after_a_step_that_failed():
    """The time of steps that were not taken is not lost: the world ends in the same state as without the failure."""

    class FailsOnce(System):
        failed = False

        def process(self, dt):
            if world.step_count == 2 and not self.failed:
                self.failed = True
                raise RuntimeError("once")

    world, other = make_world(), make_world()
    for each in (world, other):
        each.create_entity(Transform((0, 0)), RigidBody(1.0, (1.0, 0.0)))
    world.add_system(FailsOnce())
    with pytest.raises(StepError, match="once"):
        world.advance(4.5 / 60)
    assert world.step_count == 2
    assert 0.0 <= world.alpha <= 1.0
    assert world.advance(0.0) == 2
    assert other.advance(4.5 / 60) == 4
    assert world.alpha == pytest.approx(0.5, abs=1e-9)
    assert world.state_hash() == other.state_hash()
