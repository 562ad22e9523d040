"""Equal ids, equal bits: facade or plain esper, repeated runs, any history of the bodies."""

from __future__ import annotations

import esper
import numpy as np
import pytest
from helpers_determinism import STEPS, Charge, Facade, mixed_scene, settled, state
from worlds import ball, box

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform


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


@pytest.mark.slow
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
    assert contacts > 50  # there was something to compare
    assert np.isfinite(worlds[0].bodies.position).all()


N = 60


def parts(e):
    """The components of the body with that id: a function of the id alone."""
    rng = np.random.default_rng(e)
    kind = ("dynamic", "dynamic", "dynamic", "kinematic", "static")[e % 5]
    shape = AABBCollider(rng.uniform(0.2, 0.5, 2), restitution=0.5) if e % 3 else SphereCollider(0.4, restitution=0.9)
    place = Transform((1.1 * (e % 8), 1.1 * (e // 8) + 0.5), rotation=0.1 * e)
    return place, RigidBody(1.0 + e % 4, rng.normal(size=2), kind=kind), shape


def straight(world):
    for e in range(1, N + 1):
        assert world.create_entity(*parts(e)) == e


def with_others_that_went(world):
    """Ids after N are used by temporary bodies."""
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
    """First other kinds, colliders and masses; one detour over a component type that is removed again."""
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
    """Consecutive bodies with equal components in bulk, the rest one by one."""
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


@pytest.mark.slow
@pytest.mark.parametrize("build", HISTORIES, ids=lambda build: build.__name__)
def test_any_history_with_the_same_ids_gives_the_same_bits(build, expected):
    """ACCURACY C22: the order of creation, and deleted bodies, change nothing."""
    got = run_history(build)
    assert got[0] == expected[0]
    assert got[1] == expected[1]
    assert got[2] == expected[2] > 1000  # there was something to compare


def test_deleting_in_the_midst_of_a_run_leaves_no_trace_in_those_out_of_reach():
    """Distant bodies are created and deleted all the time: rows move in every step."""

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
