"""Equal ids, equal bits: facade or plain esper, any history, snapshots, repeated runs, other processes."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from pathlib import Path

import esper
import numpy as np
import pytest
from worlds import ball, box, floor, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, ForceSystem, Settings, World, column
from carom.plugins import Physics

STEPS = 220


class Charge(Component):
    value = column(default=0.0)


class Swirl(ForceSystem):
    requires = (Charge,)

    def add_forces(self, bodies, time):
        bodies.force[:, 0] -= bodies.charge.value * bodies.position[:, 1]
        bodies.force[:, 1] += bodies.charge.value * np.sin(time)


class Facade:
    """The verbs of a world."""

    def __init__(self, world):
        self.world = world
        self.create, self.delete, self.add, self.remove = (
            world.create_entity, world.delete_entity, world.add_component, world.remove_component,
        )  # fmt: skip

    def step(self):
        self.world.step()


class Plain:
    """esper's own functions, inside ``with world:``."""

    def __init__(self, world):
        self.world = world

    FUNCTIONS = {  # noqa: RUF012
        "create": esper.create_entity,
        "delete": esper.delete_entity,
        "add": esper.add_component,
        "remove": esper.remove_component,
    }

    def __getattr__(self, name):
        function = self.FUNCTIONS[name]

        def call(*args, **kwargs):
            with self.world:
                return function(*args, **kwargs)

        return call

    def step(self):
        with self.world:
            esper.process(self.world.settings.dt)


def state(world):
    """Every column, contacts included, as bytes."""
    bodies, contacts = world.bodies, world.contacts
    columns = {name: getattr(bodies, name).tobytes() for name in bodies.column_names()}
    events = {"begin": contacts.begin, "end": contacts.end, "impacts": contacts.impacts}
    for label, rows in {"now": contacts, **events}.items():
        for name in ("entity_a", "entity_b", "point", "normal", "depth", "normal_impulse", "step"):
            columns[f"{label}.{name}"] = getattr(rows, name).tobytes()
    return columns


def mixed_scene(world, use):
    """Spheres and boxes thrown at each other over a floor, while things come and go; yields after each step."""
    world.add_system(Swirl())
    rng = np.random.default_rng(11)
    use.create(Transform((0.0, -0.5)), AABBCollider((30.0, 0.5), restitution=0.3))
    use.create(Transform((0.0, 3.0)), RigidBody(kind="kinematic", linear_velocity=(0.5, 0.0)), AABBCollider((2.0, 0.2)))
    alive = []
    for step in range(STEPS):
        if step % 3 == 0 and len(alive) < 40:
            collider = (SphereCollider, AABBCollider)[step % 2](rng.uniform(0.2, 0.5), restitution=rng.random())
            body = RigidBody(rng.uniform(0.5, 5.0), rng.normal(size=2) * 4, linear_damping=0.1 * (step % 2))
            extra = [Charge(rng.normal())] if step % 5 == 0 else []
            alive.append(use.create(Transform((rng.uniform(-4, 4), rng.uniform(1, 9))), body, collider, *extra))
        if step % 7 == 6:
            use.delete(alive.pop(int(rng.integers(len(alive)))), immediate=bool(step % 2))
        if step % 11 == 10:
            use.add(alive[0], Charge(1.0))
            use.add(alive[1], RigidBody(2.0, (0.0, 3.0)))
            use.remove(alive[2], RigidBody)
        if step % 11 == 0 and step:
            use.add(alive[2], RigidBody(1.0))
        use.step()
        yield


def settled(**settings):
    return make_world(gravity=9.81, **settings)


@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "rk4"])
def test_plain_esper_gives_the_same_bits_as_the_facade(integrator):
    worlds = [settled(integrator=integrator) for _ in range(2)]
    scenes = [mixed_scene(world, use(world)) for world, use in zip(worlds, (Facade, Plain), strict=True)]
    contacts = 0
    for _ in zip(*scenes, strict=True):
        assert state(worlds[0]) == state(worlds[1])
        assert worlds[0].state_hash() == worlds[1].state_hash()
        contacts += len(worlds[0].contacts.impacts)
    assert worlds[0].step_count == STEPS
    assert contacts > 50  # there was something to differ in
    assert np.isfinite(worlds[0].bodies.position).all()


# -- histories -------------------------------------------------------------------------------------------------------

N = 60


def parts(e):
    """What the body with that id consists of: a function of the id alone."""
    rng = np.random.default_rng(e)
    kind = ("dynamic", "dynamic", "dynamic", "kinematic", "static")[e % 5]
    shape = AABBCollider(rng.uniform(0.2, 0.5, 2), restitution=0.5) if e % 3 else SphereCollider(0.4, restitution=0.9)
    place = Transform((1.1 * (e % 8), 1.1 * (e // 8) + 0.5), rotation=0.1 * e)
    return place, RigidBody(1.0 + e % 4, rng.normal(size=2), kind=kind), shape


def straight(world):
    for e in range(1, N + 1):
        assert world.create_entity(*parts(e)) == e


def with_others_that_went(world):
    """Ids after N are taken by bodies that were there for a while."""
    straight(world)
    extra = [box(world, (50.0 + 2 * x, 50.0), 1.0) for x in range(150)]  # so many that the tables grow
    world.bodies  # noqa: B018
    for e in extra[::2]:
        world.delete_entity(e, immediate=True)
    world.bodies  # noqa: B018
    with world:
        for e in extra[1::2]:
            esper.delete_entity(e)
        esper.clear_dead_entities()


def components_late_and_out_of_order(world):
    ids = [world.create_entity() for _ in range(N)]
    for e in np.random.default_rng(5).permutation(ids).tolist():
        for part in parts(e)[:: -1 if e % 2 else 1]:
            if isinstance(part, Transform):
                with world:
                    esper.add_component(e, part)
            else:
                world.add_component(e, part)
        with world:
            if all(esper.has_component(i, Transform) for i in ids if len(esper.components_for_entity(i))):
                world.bodies  # noqa: B018


def bodies_changed_their_minds(world):
    """Other kinds, other colliders and masses first; one detour over a component type that nobody has in the end."""
    for e in range(1, N + 1):
        world.create_entity(Transform((9.0 * e, 0.0)), RigidBody(7.0, kind="static"), SphereCollider(2.0), Charge(e))
    world.bodies  # noqa: B018
    for e in range(1, N + 1):
        place, body, shape = parts(e)
        world.remove_component(e, SphereCollider)
        world.remove_component(e, Charge)
        for part in (shape, body):
            world.add_component(e, part)
        transform = world.component_for_entity(e, Transform)
        transform.position, transform.rotation = place.position, place.rotation
        if e % 9 == 0:
            world.bodies  # noqa: B018


def in_bulk(world):
    """Neighbours of one make at once, the rest singly."""
    e = 1
    while e <= N:
        stop = e + 1
        while stop <= N and type(parts(stop)[2]) is type(parts(e)[2]):
            stop += 1
        made = [parts(i) for i in range(e, stop)]
        shape = type(made[0][2])
        size = "radius" if shape is SphereCollider else "half_extents"
        world.create_entities(
            stop - e,
            Transform.many([m[0].position for m in made], rotation=[m[0].rotation for m in made]),
            RigidBody.many(
                mass=[m[1].mass for m in made],
                linear_velocity=[m[1].linear_velocity for m in made],
                kind=[m[1].kind for m in made],
            ),
            shape.many(**{size: [getattr(m[2], size) for m in made]}, restitution=[m[2].restitution for m in made]),
        )
        e = stop


HISTORIES = [with_others_that_went, components_late_and_out_of_order, bodies_changed_their_minds, in_bulk]


def run_history(build):
    world = settled()
    build(world)
    hashes, touching = [], 0
    for _ in range(100):
        world.step()
        hashes.append(world.state_hash())
        touching += len(world.contacts) + len(world.contacts.impacts)
    columns = {name: value for name, value in state(world).items() if not name.startswith("charge")}
    return hashes, columns, touching


@pytest.fixture(scope="module")
def expected():
    return run_history(straight)


@pytest.mark.parametrize("build", HISTORIES, ids=lambda build: build.__name__)
def test_any_history_with_the_same_ids_gives_the_same_bits(build, expected):
    """ACCURACY C22: the order in which bodies came, and what was there before, changes nothing."""
    got = run_history(build)
    assert got[0] == expected[0]
    assert got[1] == expected[1]
    assert got[2] == expected[2] > 1000  # there was something to differ in


def test_deleting_in_the_midst_of_a_run_leaves_no_trace_in_those_out_of_reach():
    """Bodies far away come and go all the time: rows move in every step."""

    def run(disturb):
        world = settled()
        straight(world)
        visitors = []
        for _ in range(60):
            if disturb:
                for k, kind in enumerate(("dynamic", "static")):
                    visitors.append(ball(world, (500.0 + 3 * k, 500.0), 1.0, kind=kind))
                if len(visitors) > 5:
                    world.delete_entity(visitors.pop(0))
            world.step()
        mine = world.bodies.entity <= N
        names = ("entity", "position", "linear_velocity", "mass", "kind")
        return [getattr(world.bodies, name)[mine].tobytes() for name in names]

    assert run(True) == run(False)


def test_repeated_runs_are_equal():
    def run():
        world = settled()
        for _ in mixed_scene(world, Facade(world)):
            pass
        return state(world)

    assert run() == run()


# -- snapshots -------------------------------------------------------------------------------------------------------


def pile():
    world = settled()
    floor(world)
    rng = np.random.default_rng(2)
    for x in range(30):
        ball(world, (0.9 * (x % 6), 1.0 + 0.95 * (x // 6)), rng.normal(size=2) * 2, restitution=0.7)
    for _ in range(20):
        world.step()
    return world


def log_events(world, log):
    def note(name, c):
        log.append((name, c.entity_a, c.entity_b, c.step, c.depth, c.normal_impulse))

    for name in ("contact_begin", "contact_stay", "contact_end", "impact"):
        world.on(name, functools.partial(note, name))


def test_a_restored_snapshot_goes_on_with_the_same_bits_and_events():
    world, log = pile(), []
    log_events(world, log)
    snapshot = world.snapshot()
    at = (world.state_hash(), world.time, world.step_count, state(world))

    def go_on():
        log.clear()
        states = []
        for _ in range(40):
            world.step()
            states.append(state(world))
        return states, list(log), world.state_hash()

    first = go_on()
    assert len({name for name, *_ in first[1]}) == 4
    for _ in range(2):  # it can be restored as often as one likes
        world.restore(snapshot)
        assert (world.state_hash(), world.time, world.step_count, state(world)) == at
        assert go_on() == first
        world.contacts.enabled[:] = False  # what is written into the world's contacts is not written into the snapshot


def test_a_snapshot_holds_kinds_and_components_of_ones_own():
    world = make_world(dt=1.0)
    a, b = ball(world, 0.0, 1.0), ball(world, 9.0, 1.0)
    world.add_component(b, Charge(3.0))
    snapshot, digest = world.snapshot(), world.state_hash()
    world.component_for_entity(a, RigidBody).kind = "static"
    world.component_for_entity(b, Charge).value = 4.0
    world.step()
    assert world.bodies.entity.tolist() == [b, a]
    world.restore(snapshot)
    assert world.state_hash() == digest
    assert world.bodies.dynamic.entity.tolist() == [a, b]
    world.step()
    assert world.bodies.position[:, 0].tolist() == [1.0, 10.0]
    assert world.component_for_entity(b, Charge).value == 3.0


def test_a_snapshot_of_other_bodies_is_refused_and_nothing_is_disturbed():
    world = make_world()
    a = ball(world, 0.0)
    snapshot = world.snapshot()
    b = ball(world, 9.0)
    digest = world.state_hash()
    with pytest.raises(ValueError, match="other bodies"):
        world.restore(snapshot)
    assert world.state_hash() == digest
    world.delete_entity(b, immediate=True)
    world.restore(snapshot)
    for change in (
        lambda: world.add_component(a, Charge(1.0)),
        lambda: (world.remove_component(a, Charge), world.remove_component(a, SphereCollider)),
    ):
        change()
        with pytest.raises(ValueError, match=rf"entity {a}: \w+ was added or removed"):
            world.restore(snapshot)
    world.add_component(a, SphereCollider(0.5))
    world.restore(snapshot)


def test_settings_stay_when_a_snapshot_is_restored():
    world = make_world(dt=0.5)
    ball(world, 0.0, 1.0)
    snapshot = world.snapshot()
    world.settings = world.settings.replace(dt=0.25)
    world.restore(snapshot)
    world.step()
    assert (world.time, world.bodies.position[0, 0]) == (0.25, 0.25)
    assert world.advance(0.5) == 2


# -- the hash --------------------------------------------------------------------------------------------------------


def test_the_hash_notices_the_smallest_change_of_any_value():
    world = make_world()
    e = ball(world, (1.0, 2.0), 3.0)
    world.add_component(e, Charge(4.0))
    seen = {world.state_hash()}
    for component in (Transform, RigidBody, SphereCollider, Charge):
        handle = world.component_for_entity(e, component)
        for name, field in component.columns.items():
            value = getattr(handle, name)
            if isinstance(value, np.ndarray):
                new = value.copy()
                new[-1] = np.nextafter(new[-1], np.inf)
            elif isinstance(value, float):
                new = np.nextafter(value, np.inf)
            else:
                new = {"kind": "kinematic", "sensor": True, "ccd": True}.get(name, 0.25 if value is None else value)
                new = value + 1 if field.dtype is np.int64 else new
            setattr(handle, name, new)
            digest = world.state_hash()
            assert digest not in seen, name
            seen.add(digest)
    for change in (
        lambda: world.remove_component(e, Charge),
        lambda: ball(world, 50.0),
        lambda: world.delete_entity(e, immediate=True),
    ):
        change()
        assert world.state_hash() not in seen
        seen.add(world.state_hash())


def test_the_hash_does_not_tell_minus_zero_from_zero():
    worlds = [make_world() for _ in range(2)]
    for world, zero in zip(worlds, (0.0, -0.0), strict=True):
        ball(world, (zero, 1.0))
    assert worlds[0].state_hash() == worlds[1].state_hash()


def test_the_hash_is_of_the_state_not_of_the_frame_rate():
    def run(frames, per_frame):
        world = settled(dt=1 / 64)
        e = ball(world, (0.0, 1.0))
        for _ in range(frames):
            world.component_for_entity(e, RigidBody).apply_force((2.0, 0.0))
            world.advance(per_frame / 64)
        return world.step_count, world.state_hash()

    assert run(32, 1) == run(16, 2) == run(8, 4)


# -- processes -------------------------------------------------------------------------------------------------------

SCRIPT = """
import sys
sys.path.insert(0, sys.argv[1])
from test_determinism import Facade, mixed_scene, settled
world = settled()
for _ in mixed_scene(world, Facade(world)): pass
from carom.framework.compilation import log
print(world.state_hash(), len(log.compiled), log.loaded)
"""


def in_a_process(cache: Path, seed: str) -> tuple[str, int, int]:
    environment = {**os.environ, "CAROM_CACHE_DIR": str(cache), "PYTHONHASHSEED": seed}
    command = [sys.executable, "-c", SCRIPT, str(Path(__file__).parent)]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    digest, compiled, loaded = result.stdout.split()
    return digest, int(compiled), int(loaded)


@pytest.mark.slow  # compiles everything twice
def test_other_processes_with_a_cold_and_a_warm_cache_get_the_same_bits(tmp_path):
    cold, warm = in_a_process(tmp_path, "1"), in_a_process(tmp_path, "2")
    assert cold[1] > 5
    assert warm[1] == 0  # every kernel came from the disk
    assert warm[2] >= cold[1]
    world = settled()
    for _ in mixed_scene(world, Facade(world)):
        pass
    assert cold[0] == warm[0] == world.state_hash()


def test_presets_differ_and_settings_reach_the_bits():
    """A test that could not fail would pass here too: other settings are other bits."""

    def run(settings):
        world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), settings=settings)
        straight(world)
        for _ in range(20):
            world.step()
        return world.state_hash()

    assert len({run(Settings()), run(Settings(integrator="velocity_verlet")), run(Settings(dt=1 / 61))}) == 3
