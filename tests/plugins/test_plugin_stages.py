"""Stages of plugins: where they run, how often, what a failed step puts back, and what is refused."""

from __future__ import annotations

import itertools
from functools import partial

import numpy as np
import pytest
from helpers_processes import output_of
from helpers_steps import both_ways  # noqa: F401  every test with each
from worlds import METHODS, ball, floor

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Plugin, PluginError, Settings, StepError, System, World
from carom.framework.vectors import add, scale
from carom.plugins import Physics

MODES = ("discrete", "continuous", "event_driven")
COLUMNS = ("position", "previous_position", "linear_velocity", "mass", "force")


def kicking(*places, name="kicks", **more):
    """A plugin with stages that add 1 m/s along x at these places."""
    plugin = Plugin(name)
    for number, place in enumerate(places):

        def kick(state, dt):
            """A kick along x"""
            velocity = state.bodies.linear_velocity
            for i in range(state.first, state.dynamic):
                velocity[i] = add(velocity[i], (1.0, 0.0))

        kick.__name__ = f"kick_{number}"
        plugin.stage(**dict([place]), writes=("linear_velocity",), **more)(kick)
    return plugin


def thrown(*plugins, gravity=0.0, systems=(), collider=True, **settings):
    world = World(Physics(dimensions=2, gravity=(0.0, gravity)), *plugins, settings=Settings(**settings))
    world.create_entity(Transform((0.0, 0.0)), RigidBody(), *([SphereCollider(0.5)] if collider else []))
    for system in systems:
        world.add_system(system())
    return world


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("place", "moves"),
    [
        (("before", "check_columns"), 1.0), (("after", "sum_forces"), 1.0), (("before", "keep_start"), 1.0),
        (("before", "end_flight"), 0.0), (("after", "put_back"), 0.0), (("after", "publish_contacts"), 0.0),
        (("after", "compare_contacts"), 0.0), (("before", "close_step"), 0.0),
    ],
)  # fmt: skip
def test_a_stage_runs_once_a_step_at_its_place(place, moves, mode):
    """A change of velocity before the flight moves the body in the same step, one after it does not."""
    with thrown(kicking(place), collision=mode, substeps=8) as world:
        for step in range(1, 4):
            world.step()
            body = world.bodies.dynamic
            assert body.linear_velocity[0].tolist() == [step, 0.0]
            assert 60.0 * body.position[0, 0] == pytest.approx(step * (step - 1) / 2 + step * moves, abs=1e-12)


def order_of(world):
    return [kernel.kernel for entry in world.plan().entries for kernel in entry.kernels]


def test_stages_at_one_place_run_in_the_order_of_the_plugins_and_of_registration():
    """Factors and sums do not commute, so the result tells the order."""
    one, two = Plugin("one"), Plugin("two")

    @two.stage(after="put_back", writes=("linear_velocity",))
    def doubled(state, dt):
        state.bodies.linear_velocity[0] = scale(state.bodies.linear_velocity[0], 2.0)

    @one.stage(before="resolve_static_penetration", writes=("linear_velocity",))
    def later(state, dt):
        state.bodies.linear_velocity[0] = add(state.bodies.linear_velocity[0], (5.0, 0.0))

    @one.stage(after="put_back", writes=("linear_velocity",))
    def raised(state, dt):
        state.bodies.linear_velocity[0] = add(state.bodies.linear_velocity[0], (1.0, 0.0))

    for plugins, expected, speed in (
        ((one, two), ["put_back", "raised", "doubled", "later", "resolve_static_penetration"], 7.0),
        ((two, one), ["put_back", "doubled", "raised", "later", "resolve_static_penetration"], 6.0),
    ):
        with thrown(*plugins) as world:
            names = order_of(world)
            start = names.index("put_back")
            assert names[start : start + 5] == expected
            world.step()
            assert world.bodies.linear_velocity[0, 0] == speed


def test_the_plan_names_plugin_and_purpose_and_stats_count_its_calls():
    with thrown(kicking(("after", "put_back"))) as world:
        response = next(entry for entry in world.plan().entries if entry.system == "Response")
        assert "plugin kicks: A kick along x" in [kernel.reason for kernel in response.kernels]
        with world.profile():
            for _ in range(5):
                world.step()
        assert "kick_0" in str(world.stats())
    with thrown(kicking(("before", "close_step"))) as world:
        assert "kick_0" in [kernel.kernel for kernel in world.plan().around]


def test_a_stage_is_left_out_where_its_condition_does_not_hold():
    with thrown(kicking(("after", "put_back"), needed="sleeping")) as world:
        assert "kick_0" not in order_of(world)
        world.step()
        assert not world.bodies.linear_velocity.any()


def test_a_stage_that_comes_while_the_world_runs_is_there_in_the_next_step():
    """And what the others have taken is still counted."""
    plugin = kicking()
    with thrown(plugin) as world, world.profile():
        world.step()
        world.reset_stats()
        for _ in range(3):
            world.step()

        @plugin.stage(after="put_back", writes=("linear_velocity",))
        def kick_late(state, dt):
            state.bodies.linear_velocity[0] = add(state.bodies.linear_velocity[0], (1.0, 0.0))

        world.step()
        world.step()
        assert world.bodies.linear_velocity[0, 0] == 2.0
        world.add_plugin(kicking(("after", "put_back"), name="more kicks"))
        world.step()
        assert world.bodies.linear_velocity[0, 0] == 4.0
        calls = {row.kernel: row.calls * world.stats().steps for row in world.stats().kernels}
        assert (calls["put_back"], calls["kick_late"], calls["kick_0"]) == (6, 3, 1)


class Idle(System):
    def process(self, dt):
        """Nothing: that it is there splits the step into several calls."""


def bouncing(*plugins, gravity=-9.81, **more):
    world = thrown(*plugins, gravity=gravity, collider=False, **more)
    floor(world, restitution=0.5)
    for k in range(6):
        ball(world, (0.1 * k, 0.6 + 1.1 * k), (0.3, -2.0), restitution=0.4)
    return world


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_stage_that_changes_nothing_changes_no_bit(mode):
    idle = Plugin("idle")

    @idle.stage(after="sum_forces", reads=("force",), writes=("step_force", "gravity_scale"))
    def look(state, dt):
        total = 0.0
        for i in range(state.first, state.dynamic):
            total += state.bodies.force[i][0]

    hashes = set()
    for plugins, systems in itertools.product(((), (idle,)), ((), (Idle,))):
        with bouncing(*plugins, systems=systems, collision=mode) as world:
            for _ in range(60):
                world.step()
            hashes.add(world.state_hash())
    assert len(hashes) == 1


def push_with(column):
    """A plugin whose stage pushes along x as much as RigidBody(constant_force=(3, 0)) does."""
    plugin = Plugin("wind")

    @plugin.stage(after="sum_forces", writes=(column,))
    def blow(state, dt):
        force = state.bodies.force
        for i in range(state.force_first, state.dynamic):
            force[i] = add(force[i], (3.0, 0.0))

    return plugin


class Drag(ForceSystem):
    def add_forces(self, bodies, time):
        bodies.force -= 0.2 * bodies.linear_velocity


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4"])
@pytest.mark.parametrize("forced", [False, True])
def test_a_force_at_the_sum_of_forces_counts_whenever_they_are_summed(integrator, forced):
    """The same bits as those of a constant force, also where force systems make the integrator sum several times."""
    hashes = []
    for plugins, constant in (((push_with("force"),), 0.0), ((), 3.0)):
        with World(Physics(dimensions=2), *plugins, settings=Settings(integrator=integrator)) as world:
            entity = world.create_entity(Transform((0, 0)), RigidBody(constant_force=(constant, 0.0)))
            if forced:
                world.add_system(Drag())
            for _ in range(20):
                world.step()
            hashes.append(world.bodies.position.tobytes() + world.bodies.linear_velocity.tobytes())
            assert world.component_for_entity(entity, Transform).x > 0.1
    assert hashes[0] == hashes[1]


def columns(world):
    return {name: np.array(getattr(world.bodies, name)) for name in COLUMNS}


@pytest.mark.slow
@pytest.mark.parametrize("colliders", [True, False])
@pytest.mark.parametrize("systems", [(), (Idle,)], ids=["alone", "with a system"])
@pytest.mark.parametrize("anchor", ["check_columns", "keep_start", "check_flight", "close_step"])
def test_a_failed_step_puts_back_what_stages_have_written(anchor, systems, colliders):
    """Columns that built-in stages never write, and those that they keep later than this stage writes them."""
    plugin = Plugin("failing")

    @plugin.stage(before="check_columns", writes=("mass", "gravity_scale", "position", "linear_velocity"))
    def change(state, dt):
        bodies = state.bodies
        for i in range(state.first, state.dynamic):
            bodies.mass[i], bodies.gravity_scale[i] = 2.0 * bodies.mass[i], 0.5
            bodies.position[i] = add(bodies.position[i], (0.0, 0.25))
            bodies.linear_velocity[i] = add(bodies.linear_velocity[i], (0.5, 0.0))

    @plugin.stage(before=anchor)
    def fail(state, dt):
        if state.step_number == 3:
            raise ValueError("no more", state.step_number)

    make = bouncing if colliders else partial(thrown, collider=False)
    with make(plugin, systems=systems, gravity=-9.81) as world:
        world.create_entity(Transform((20, 5)), RigidBody(2.0, (1, 0)))
        for _ in range(3):
            world.step()
        before, hashed, twin = columns(world), world.state_hash(), world.snapshot()
        for _ in range(2):
            with pytest.raises(StepError, match=r"plugin failing: stage fail: ValueError: \('no more', 3\)"):
                world.step()
            for name, column in columns(world).items():
                if name != "force":  # summed by each step
                    np.testing.assert_array_equal(column, before[name], err_msg=name)
            assert world.state_hash() == hashed
        world.restore(twin)
        assert world.state_hash() == hashed


def bare(state, dt):
    pass


def uses_mass(state, dt):
    state.bodies.mass[0] = 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("function", "options", "message"),
    [
        (bare, {"after": "putback"}, "after='putback': there is no such stage .did you mean 'put_back'"),
        (bare, {"after": "semi_implicit_euler"}, "belongs to some integrators: before='end_flight'"),
        (bare, {"before": "merge_pairs"}, "before='merge_pairs': that stage is no part of every step"),
        (bare, {"after": "close_step"}, "not undone if the step fails"),
        (bare, {"after": "keep_state"}, "the first place is before='check_columns'"),
        (bare, {"after": "put_back", "needed": "bodys"}, "needed must be one of .*, got 'bodys'"),
        (bare, {"after": "put_back", "reads": ("positon",)}, "no record has 'positon' .did you mean 'position'"),
        (bare, {"after": "put_back", "writes": ("entity",)}, "it writes entity, which is for reading only"),
        (bare, {"after": "test_few", "writes": ("position",)}, "may run several times in a step"),
        (uses_mass, {"after": "put_back"}, "it uses mass, and names it neither in reads nor in writes"),
    ],
)
def test_what_no_step_can_have_is_refused_by_name(function, options, message):
    plugin = Plugin("wrong")
    plugin.stage(**options)(function)
    with pytest.raises(PluginError, match=f"plugin wrong: stage {function.__name__}, .*{message}"):
        World(Physics(dimensions=2), plugin)
    late = Plugin("wrong")
    with thrown(late) as world:
        with pytest.raises(PluginError, match=message):
            late.stage(**options)(function)
        assert not late.stages
        world.step()


@pytest.mark.parametrize(
    ("function", "options", "message"),
    [
        (lambda state, dt: None, {"after": "put_back"}, "register a plain function with a name"),
        (bare, {}, "say after= or before= which one stage, got after='', before=''"),
        (bare, {"after": "put_back", "before": "gather"}, "say after= or before= which one"),
        (bare, {"after": "put_back", "writes": "position"}, "writes takes a tuple of names, got 'position'"),
        (order_of, {"after": "put_back"}, r"takes \(world\), it must take 2 arguments: \(state, dt\)"),
    ],
)
def test_what_can_be_no_stage_is_refused_at_once(function, options, message):
    with pytest.raises(PluginError, match=f"plugin wrong: stage .*{message}"):
        Plugin("wrong").stage(**options)(function)


def test_a_stage_returns_nothing_and_needs_a_place():
    def answers(state, dt):
        if dt > 1.0:
            return 3

    with pytest.raises(PluginError, match="stage answers must return nothing"):
        Plugin("wrong").stage(after="put_back")(answers)
    with pytest.raises(PluginError, match="stage on bare takes arguments"):
        Plugin("wrong").stage(bare)


def test_names_are_taken_once():
    def drift(state, dt):
        pass

    plugin = Plugin("wrong")
    plugin.stage(after="put_back")(drift)
    with pytest.raises(PluginError, match="a built-in stage has that name"):
        World(Physics(dimensions=2), plugin)
    plugins = Plugin("one"), Plugin("two")
    for each in plugins:
        each.stage(after="put_back")(bare)
    with pytest.raises(PluginError, match="plugin two: stage bare is registered already, by plugin one"):
        World(Physics(dimensions=2), *plugins)


HEAVY = {0: 1.0}


def scribble(state, dt):
    state.bodies.mass[0] = "heavy"


def scribble_long(state, dt):
    state.bodies.force[0] = (0.0, 1.0, 0.0)


def scribble_short(state, dt):
    state.bodies.force[0] = 1.0


def scribble_by_dictionary(state, dt):
    state.bodies.mass[0] = HEAVY[0]


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("stage", "why"),
    [
        (scribble, "float64"), (scribble_long, "takes 2 numbers here, got 3"),
        (scribble_short, "takes 2 numbers here, got one"), (scribble_by_dictionary, "name 'HEAVY'"),
    ],
)  # fmt: skip
def test_what_cannot_be_compiled_is_named_before_a_step_begins(stage, why):
    plugin = Plugin("wrong")
    plugin.stage(after="put_back", writes=("mass", "force"))(stage)
    cure = "use numbers, tuples, math"
    message = rf"(?s)plugin wrong: stage {stage.__name__} cannot be compiled; {cure}.*{why}"
    with thrown(plugin) as world, pytest.raises(StepError, match=message):
        world.step()


PROGRAM = """
from carom import Component, Physics, Plugin, RigidBody, Transform, World, column
from carom.framework.jit.log import log
from carom.framework.vectors import add, scale

plugin = Plugin("swirl")

class Swirl(Component):
    rate = column(1.0)

@plugin.stage(before="end_flight", records=(Swirl,), writes=("linear_velocity", "swirl.rate"))
def swirling(state, dt, swirl):
    velocity = state.bodies.linear_velocity
    for i in range(state.first, state.dynamic):
        x, y = velocity[i]
        velocity[i] = add(velocity[i], scale((-y, x), dt * swirl.rate[i]))
        swirl.rate[i] *= 1.01

world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), plugin)
places, rates = [(i, 0.1 * i) for i in range(20)], [0.1 * i for i in range(20)]
world.create_entities(20, Transform.many(places), RigidBody.many(), Swirl.many(rates))
for _ in range(30):
    world.step()
print(world.state_hash(), any("swirling" in name for name, _ in log.compiled), len(log.compiled))
"""


@pytest.mark.slow
@pytest.mark.compiled
def test_a_cold_and_a_warm_cache_give_the_same_bits(tmp_path):
    folder = tmp_path / "cache"
    (cold, compiled, _), (warm, _, again) = (
        output_of(PROGRAM, CAROM_CACHE_DIR=str(folder), CAROM_BACKGROUND="0").split()
        for _ in range(2)
    )
    assert cold == warm
    assert compiled == "True"
    assert again == "0"


def test_columns_that_a_stage_names_have_rows_where_nothing_else_needs_them():
    """Also after there have come more bodies than there was room for."""
    plugin, names = Plugin("curious"), ("path_velocity", "path_second", "flight_velocity", "linear_damping", "rotation")

    @plugin.stage(before="close_step", reads=names, writes=("constant_force",))
    def count_rows(state, dt):
        bodies = state.bodies
        shortest = min(len(bodies.path_velocity), len(bodies.path_second), len(bodies.flight_velocity))
        shortest = min(shortest, len(bodies.linear_damping), len(bodies.rotation), len(bodies.constant_force))
        if shortest < state.count:
            raise ValueError("too short", shortest)
        for i in range(state.first, state.moving):
            bodies.constant_force[i] = add(bodies.path_second[i], (bodies.rotation[i], bodies.linear_damping[i]))

    with World(Physics(dimensions=2), plugin) as world:
        for count in (3, 300):
            world.create_entities(
                count, Transform.many(np.zeros((count, 2)), rotation=0.5), RigidBody.many(linear_damping=0.25)
            )
            world.step()
            assert (world.bodies.constant_force == (0.5, 0.25)).all()


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{"integrator": name} for name in METHODS] + [{"collision": "event_driven"}])
def test_forces_that_depend_on_where_bodies_are_have_the_bits_of_a_force_system(settings):
    """A spring to the origin with drag, beside a push: integrators of several evaluations sum them again."""
    plugin = Plugin("spring")

    @plugin.stage(after="sum_forces", reads=("position", "linear_velocity"), writes=("force",))
    def pull(state, dt):
        for i in range(state.force_first, state.dynamic):
            drawn = add(scale(state.bodies.position[i], -9.0), scale(state.bodies.linear_velocity[i], -0.1))
            state.bodies.force[i] = add(state.bodies.force[i], drawn)

    class Pull(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force += -9.0 * bodies.position + -0.1 * bodies.linear_velocity

    places = []
    for plugins in ((plugin,), ()):
        world = World(Physics(2, gravity=(0.0, -1.0)), *plugins, settings=Settings(**settings))
        body = RigidBody(linear_velocity=(0.0, 2.0), constant_force=(0.5, 0.0), linear_damping=0.25)
        world.create_entity(Transform((1.0, 0.0)), body)
        if not plugins:
            world.add_system(Pull())
        for _ in range(120):
            world.step()
        places.append(world.bodies.position.copy())
    np.testing.assert_array_equal(*places)
