"""A wheel holds all that games of what ships can call, in whatever mixture: told by the functions, not by compiling."""

from __future__ import annotations

import importlib
import itertools
import pkgutil
from contextlib import closing
from functools import cache

import helpers_zoo
import numpy as np
import pytest
from joints.helpers_machines import Gear, body, machine_world, machines
from worlds import METHODS, MODES, registry

from carom import plugins, scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.components.part_of import PartOf
from carom.framework import Plugin, Settings, World
from carom.framework.jit.lazy import JIT
from carom.framework.jit.linking import Linked
from carom.framework.plugins.discovery import shipped
from carom.lab.cli.warm_up import shipped_kernels
from carom.plugins import Physics
from carom.plugins.character import Character, Ladder
from carom.plugins.joints import Hinge
from carom.plugins.rotation import BoxCollider, Spin
from carom.plugins.zones import Field, Water, Wind
from carom.systems.linking.preparation import all_functions, kind_of_world, needed_functions
from carom.systems.shapes.linking import linked_shapes

pytestmark = pytest.mark.skipif(not JIT, reason="Python has no kernels")


@cache
def in_wheels():
    return {function.symbol for d in (2, 3) for function in shipped_kernels(d)}


def beyond(functions, *own):
    """Those that no wheel has, nor what is made for a game with plugins of its own."""
    made = {f.symbol for d in (2, 3) for f in all_functions(registry(*shipped(), *own), d)} if own else set()
    known = in_wheels() | made
    return sorted(str(function.py_func) for function in functions if function.symbol not in known)


@pytest.fixture
def called(monkeypatch):
    """What steps and queries ask for the address of, linked before or not."""
    found, address = {}, Linked.address.fget
    monkeypatch.setattr(Linked, "address", property(lambda linked: found.setdefault(linked, address(linked))))
    linked_shapes._made.cache_clear()  # they hold addresses
    return found


def ask(world):
    """Every query, with every shape that there may be."""
    d = world.dimensions
    origin, ahead = np.zeros(d), np.eye(d)[0]
    world.query_point(origin), world.query_sphere(origin, 3.0), world.query_aabb(origin, origin + 1.0)
    world.neighbours(1.0), world.query_nearest(origin), world.ray_cast(origin, ahead)
    for shape in world.registry.shapes:
        if d in shape.dimensions:
            world.shape_cast(shape.sample(), origin, ahead), world.overlaps(shape.sample(), origin)


def play(world):
    """Prepare it, step, ask, and go back; the names of what it needs that no wheel has."""
    simulation = world.physics
    world.prepare()
    for _ in range(10):
        world.step()
    ask(world)
    kept = world.snapshot()
    world.step()
    world.restore(kept)
    world.step()
    return beyond(needed_functions(*kind_of_world(simulation.scene, simulation.integration, simulation.program)))


def everything(d, mode, method):
    """All plugins that ship, bodies of all their shapes, turning and not, joints, parts, zones, characters."""
    settings = Settings(collision=mode, integrator=method, sleeping=True)
    world = World(Physics(d, gravity=(0.0, -9.81, 0.0)[:d]), *shipped(), settings=settings)
    world.create_entity(Transform((0.0,) * d), AABBCollider(1.0, one_way=(0.0, 1.0, 0.0)[:d], friction=0.5))
    for k, shape in enumerate(each for each in world.registry.shapes if d in each.dimensions):
        moves = world.registry.shapes[shape].second_moments and RigidBody not in shape.excludes
        body = (RigidBody(ccd=k % 2 == 0), *(() if shape in Spin.excludes else (Spin(),))) if moves else ()
        for count in range(len(body) + 1):
            place = Transform((0.3 * k - 1.0, 1.0 + count, *[0.0] * (d - 2)))
            world.create_entity(place, shape.sample(), *(each.copy() for each in body[:count]))
    a, b = (world.create_entity(Transform((5.0 + k,) * d), RigidBody(), Spin(), BoxCollider(0.3)) for k in (0, 1))
    world.create_entity(Hinge(a, b, (5.5,) * d, **({"axis": (0.0, 0.0, 1.0)} if d == 3 else {})))
    world.create_entity(PartOf(b, (0.4,) * d), SphereCollider(0.2, restitution=0.5))
    for zone in (Water(1.0), Wind((1.0,) * d), Field(1.0)):
        world.create_entity(Transform((5.0,) * d), AABBCollider(2.0, sensor=True), zone)
    hero = RigidBody(kind="kinematic"), SphereCollider(0.4), Character()
    world.create_entity(Transform((-3.0,) * d), *hero)
    world.create_entity(Transform((-3.0,) * d), AABBCollider(1.0, sensor=True), Ladder())
    return world


@pytest.mark.parametrize(("d", "mode", "method"), [
    (2 + (j + k) % 2, mode, method) for j, mode in enumerate(MODES) for k, method in enumerate(METHODS)
])  # fmt: skip
def test_everything_together_is_in_wheels(called, d, mode, method):
    with closing(everything(d, mode, method)) as world:
        assert play(world) == []
    assert beyond(called) == []


@pytest.mark.parametrize("name", scenes.names())
def test_scenes_are_in_wheels(called, name):
    with closing(scenes.get(name).build()) as world:
        assert play(world) == []
    assert beyond(called) == []


@pytest.mark.parametrize(("name", "run"), [pytest.param(*one, id=one[0]) for one in helpers_zoo.scenarios()])
def test_the_zoo_is_in_wheels(called, name, run):
    run()
    assert called
    own = [helpers_zoo.gems] if name.startswith(("buried", "asked")) else []
    assert bool(beyond(called)) == bool(own)
    assert beyond(called, *own) == []


@pytest.mark.parametrize("d", [2, 3])
def test_joints_of_a_game_are_in_what_is_made_for_it(called, d):
    world, _ = machine_world(d)
    a, b = body(world, (0, 0)), body(world, (2, 0))
    world.create_entity(Gear(a, b, 0.5, **({} if d == 2 else {"axle_a": (0, 0, 1), "axle_b": (0, 1, 0)})))
    world.step()
    assert beyond(called)
    assert beyond(called, machines) == []


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_two_plugins_need_nothing_that_all_together_do_not(d):
    """So a world of all of them stands for those of any."""
    for some in itertools.chain.from_iterable(itertools.combinations(shipped(), count) for count in range(3)):
        assert beyond(all_functions(registry(*some), d)) == [], some


def test_all_plugins_of_the_package_ship():
    """Else warm-up would not see them; if this fails alone, install the checkout again."""
    found = set()
    for place in pkgutil.iter_modules(plugins.__path__):
        module = importlib.import_module(f"{plugins.__name__}.{place.name}")
        kinds = (each for each in vars(module).values() if getattr(each, "__module__", "") == module.__name__)
        if hasattr(module, "plugin") or any(isinstance(kind, type) and issubclass(kind, Plugin) for kind in kinds):
            found.add(place.name)
    assert found - {"physics"} == {plugin.name.replace(" ", "_") for plugin in shipped()}
