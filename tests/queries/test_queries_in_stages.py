"""Queries inside stages of plugins give what those of the world give at the end of the step."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_character import FIGURES, plugins_of

from carom import (
    AABBCollider,
    Collider,
    Component,
    Phase,
    Physics,
    Plugin,
    RigidBody,
    SphereCollider,
    System,
    TileGridCollider,
    Transform,
    World,
    create_chain,
    create_height_field,
)
from carom.framework import column
from carom.framework.errors import PluginError
from carom.framework.vectors import absolute, add, length, scale, sub
from carom.systems.queries.compiled import NEAR, Path, cast, inverse_of, make_gather, meets, overlap

LAYERS = (1, 2, 4)


class Probe(Component):
    """What a body finds: how many touch it, how deep the deepest is in it, and what is first on its way."""

    way = column(0.0, item="vector")
    touching = column(0, dtype=int)
    deepest = column(0.0)
    first = column(-1, dtype=int)
    distance = column(0.0)


probes = Plugin("probes")
probes.component(Probe)
gather = make_gather(meets)


@probes.stage(
    before="update_sleep", records=(Probe, NEAR), needed="colliders",
    reads=("tree", "static_tree", "grid", "static_grid", "position", "half_extents", "entity", "probe.way"),
    writes=("probe.touching", "probe.deepest", "probe.first", "probe.distance"),
)  # fmt: skip
def look(state, dt, probe, near):
    """Bodies look around"""
    if len(near.row) < state.count:
        return state.count
    for i in range(state.first, state.count):
        if probe.present[i]:
            at, half, way = state.bodies.position[i], state.bodies.half_extents[i], probe.way[i]
            reach = length(way)
            path = Path(at, scale(way, 1.0 / reach), inverse_of(scale(way, 1.0 / reach)), half)
            probe.touching[i], probe.deepest[i], probe.first[i], probe.distance[i] = 0, 0.0, -1, reach
            low, high = sub(at, half), add(at, half)
            for k in range(gather(state, near, i, low, high)):
                depth, _, _ = overlap(state, i, near.row[k], at)
                if depth >= 0.0:
                    probe.touching[i] += 1
                    probe.deepest[i] = max(probe.deepest[i], depth)
            low, high = sub(low, absolute(way)), add(high, absolute(way))
            for k in range(gather(state, near, i, low, high)):
                touches, distance, _, _ = cast(state, near, i, near.row[k], path, reach, reach)
                if touches and distance < probe.distance[i]:
                    probe.first[i], probe.distance[i] = state.bodies.entity[near.row[k]], distance
    return state.count


class Shuffle(System):
    """Code of the game moves bodies at the end of the step: the stage comes after it."""

    phase = Phase.END

    def process(self, dt):
        bodies = self.world.bodies
        bodies.position[:] += 0.1 * np.sin(np.arange(bodies.position.size)).reshape(bodies.position.shape)


@pytest.mark.parametrize("count", [30, 300])
@pytest.mark.parametrize("dimensions", [2, pytest.param(3, marks=pytest.mark.long)])
def test_stages_find_what_queries_find(dimensions, count):
    rng = np.random.default_rng(57 + count)
    with World(Physics(dimensions, gravity=0.0), probes) as world:
        world.add_system(Shuffle())
        size = 2.5 * count ** (1 / dimensions)
        for n in range(count):
            own = {"layer": int(rng.choice(LAYERS)), "mask": int(rng.integers(1, 8)), "sensor": True}
            shape = (SphereCollider, AABBCollider)[n % 2](rng.uniform(0.3, 1.0), **own)
            way = rng.normal(size=dimensions)
            body = (RigidBody(kind="kinematic"),) if n % 3 else ()
            world.create_entity(Transform(rng.uniform(0, size, dimensions)), *body, shape, Probe(way=way))
        for _ in range(2):
            world.step()
        found = 0
        for entity, probe in world.get_component(Probe):
            shape = next(each for each in world.components_for_entity(entity) if isinstance(each, Collider))
            at = world.component_for_entity(entity, Transform).position
            hits = world.overlaps(shape, at, exclude=entity)
            assert probe.touching == len(hits)
            assert probe.deepest == pytest.approx(hits[0].depth if hits else 0.0, abs=1e-9)
            casts = world.shape_cast(shape, at, probe.way, exclude=entity, only_nearest=True)
            reach = float(np.linalg.norm(probe.way))
            assert probe.distance == pytest.approx(casts[0].distance if casts else reach, abs=1e-9)
            assert probe.first == (casts[0].entity if casts else -1) or len(hits) > 1  # ties at 0
            found += len(hits) + len(casts)
        assert found > count / 10


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_what_a_stage_casts_does_not_hang_on_what_was_cast_before(d):
    """To the last digit, whether that went a hair's breadth or to the horizon: on tiles, terrain and other shapes."""
    for seed in range(4):
        found = []
        for before in (1e-3, 3e4):
            rng = np.random.default_rng(seed)
            with World(*plugins_of(d, 0.0), probes) as world:
                figure = FIGURES["capsule 2D" if d == 2 else "capsule 3D"]

                def look_from(at, way, figure=figure, world=world):
                    body = RigidBody(kind="kinematic"), figure.collider(sensor=True, layer=2, mask=1)
                    return world.create_entity(Transform(at), *body, Probe(way=way))

                look_from((-1e5,) * d, (before,) * d)
                world.create_entity(Transform((-1e5,) * d), SphereCollider(1.0))
                if d == 2:
                    heights = 8 + np.cumsum(rng.integers(-1, 2, 60)).clip(-6, 6)
                    cells = np.arange(30)[::-1, None] < heights
                    world.create_entity(Transform((0, 0)), TileGridCollider(cells, 1.0, lower=(0, 0)))
                    create_chain(world, np.stack((np.arange(60.0), 10 + rng.uniform(0, 3, 60)), axis=1))
                else:
                    create_height_field(world, rng.uniform(8, 10, (20, 20)), 3.0)
                for n in range(40):
                    shape = (SphereCollider, AABBCollider)[n % 2](rng.uniform(0.3, 1.0))
                    world.create_entity(Transform(rng.uniform(8, (56, 14, 56)[:d])), shape)
                probing = [look_from(rng.uniform(4, 56, d) * (1, 0.1, 1)[:d] + (0, 8, 0)[:d], rng.normal(size=d))
                           for _ in range(80)]  # fmt: skip
                world.step()
                probed = [world.component_for_entity(entity, Probe) for entity in probing]
                found.append([(probe.first, probe.distance) for probe in probed])
        assert found[0] == found[1]
        assert sum(first >= 0 for first, _ in found[0]) > 15


def test_elsewhere_in_the_step_a_stage_does_not_know_where_bodies_are():
    plugin = Plugin("early")

    @plugin.stage(after="sum_forces", records=(Probe, NEAR), reads=("tree",))
    def look_too_early(state, dt, probe, near):
        pass

    with pytest.raises(PluginError, match=r"look_too_early.*reads tree.*before='update_sleep' or later"):
        World(Physics(), plugin)
