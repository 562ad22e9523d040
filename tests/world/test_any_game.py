"""Whatever a game that hypothesis plays does, in any order: after each step and answer, brute force agrees."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from helpers_filters import pairs
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test
from oracles.narrow_naive import box_box, sphere_box, sphere_sphere
from worlds import MODES

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, Settings, StepError, World, column
from carom.plugins import Physics

MOST = 12  # bodies: enough for heaps, few enough to look at each pair
GRAVITY = 5.0  # m/s^2, where there is any
NEAR = 0.02  # of the smaller of two: what overlaps by more must be told, what is further apart must not
SURE = 1e-9  # m; what is nearer to a touch than that may be found or not
LAYERS = (1, 2, 3)

coordinate = st.floats(-3.0, 3.0).map(lambda x: round(x, 3))
size = st.sampled_from((0.2, 0.35, 0.5, 0.8))
number = st.integers(0, 1000)
kind = st.sampled_from(("dynamic", "dynamic", "dynamic", "kinematic", "static"))
mode = st.sampled_from(MODES)


def vector(d):
    return st.tuples(*[coordinate] * d).map(np.array)


SPOILED, MENDED = "spoiled", "mended"  # until the next step


class Health(Component):
    """A game's own component."""

    left = column(default=3.0)


class RaisedError(Exception):
    """By a handler."""


class Solid:
    """A body as it is in the columns, and its plain geometry."""

    def __init__(self, world, entity):
        self.entity = entity
        at = lambda component: world.component_for_entity(entity, component)  # noqa: E731
        self.centre = np.array(at(Transform).position)
        self.is_ball = world.has_component(entity, SphereCollider)
        self.collider = at(SphereCollider if self.is_ball else AABBCollider)
        self.reach = self.collider.radius if self.is_ball else np.array(self.collider.half_extents)
        self.size, self.around = float(np.min(self.reach)), np.full(len(self.centre), self.reach)
        self.body = at(RigidBody) if world.has_component(entity, RigidBody) else None
        self.speed = 0.0 if self.body is None else float(np.linalg.norm(self.body.linear_velocity))
        self.kind = "static" if self.body is None else self.body.kind

    def depth(self, other):
        """Of the overlap with another; negative apart."""
        if self.is_ball:
            return other.depth_of_ball(self.centre, self.reach)
        if other.is_ball:
            return self.depth_of_ball(other.centre, other.reach)
        return box_depth(self.centre, self.reach, other.centre, other.reach)

    def depth_of_ball(self, centre, radius):
        if self.is_ball:
            return sphere_sphere(self.centre, self.reach, centre, radius)[0]
        return sphere_box(centre, radius, self.centre, self.reach)[0]

    def may_meet(self, other):
        a, b = self.collider, other.collider
        together = a.group == b.group != 0
        moves = {self.kind, other.kind} != {"static"}
        return moves and bool(a.layer & b.mask) and bool(b.layer & a.mask) and not together


def box_depth(a, half_a, b, half_b):
    """As box_box, but apart the distance of the two."""
    depth = box_box(a, half_a, b, half_b)[0]
    gap = np.maximum(np.abs(b - a) - half_a - half_b, 0.0)
    return depth if depth >= 0 else -float(np.linalg.norm(gap))


class Game(RuleBasedStateMachine):
    """A world, and what the game knows of it."""

    steps = 0  # of all games
    world: World

    @initialize(
        d=st.sampled_from((2, 3)), mode=mode, gravity=st.sampled_from((0.0, GRAVITY, GRAVITY)), sleeping=st.booleans()
    )
    def begin(self, d, mode, gravity, sleeping):
        self.d, self.touching, self.kept, self.spoiled, self.raises = d, set(), [], {}, False
        self.folder = tempfile.TemporaryDirectory()
        self.gravity = tuple(-gravity * (k == 1) for k in range(d))
        chosen = Settings(collision=mode, sleeping=sleeping, on_fault="ignore")
        self.enter(World(Physics(d, self.gravity), settings=chosen))
        half = np.where(np.arange(d) == 1, 0.5, 6.0)
        self.world.create_entity(Transform(-4.0 * (np.arange(d) == 1)), AABBCollider(half, friction=0.5))

    def enter(self, world):
        self.world = world
        world.on("contact_begin", self.handle)

    def handle(self, contact):
        if self.raises:
            raise RaisedError

    def teardown(self):
        if hasattr(self, "world"):
            self.world.close()
            self.folder.cleanup()

    def entities(self, *having):
        return sorted({entity for entity, _ in self.world.get_components(Transform, *having)})

    def pick(self, number, *having):
        """One of those, or None."""
        found = self.entities(*having)
        return found[number % len(found)] if found else None

    def solids(self):
        world = self.world
        having = sorted({*self.entities(SphereCollider), *self.entities(AABBCollider)})
        return [Solid(world, entity) for entity in having if entity not in self.spoiled]

    # -- bodies come and go -----------------------------------------------------------------------

    def shape(self, ball, size, **common):
        return SphereCollider(size, **common) if ball else AABBCollider(np.linspace(size, 0.8 * size, self.d), **common)

    @precondition(lambda self: len(self.world.bodies) < MOST)
    @rule(
        data=st.data(), ball=st.booleans(), size=size, kind=kind, sensor=st.integers(0, 5).map(lambda n: n == 0),
        restitution=st.sampled_from((0.0, 0.0, 0.5, 1.0)), layer=st.sampled_from(LAYERS),
    )  # fmt: skip
    def spawn(self, data, ball, size, kind, sensor, restitution, layer):
        place, speed = data.draw(vector(self.d)), 2.0 * data.draw(vector(self.d))
        body = RigidBody(kind=kind, linear_velocity=speed * (kind != "static"))
        collider = self.shape(ball, size, sensor=sensor, restitution=restitution, layer=layer, friction=0.5)
        self.world.create_entity(Transform(place), body, collider, Health())

    @precondition(lambda self: len(self.world.bodies) < MOST)
    @rule(data=st.data(), count=st.integers(1, 3))
    def spawn_many(self, data, count):
        places = np.array([data.draw(vector(self.d)) for _ in range(count)])
        self.world.create_entities(
            count, Transform.many(places), RigidBody.many(mass=2.0), SphereCollider.many(radius=0.3, friction=0.5)
        )

    @rule(number=number, immediate=st.booleans())
    def delete(self, number, immediate):
        entity = self.pick(number)
        if entity is not None:
            self.world.delete_entity(entity, immediate=immediate)

    @rule(number=number, ball=st.booleans(), size=size)
    def replace_or_take_collider(self, number, ball, size):
        """Of a body: another one, or none."""
        entity = self.pick(number, RigidBody)
        if entity is None:
            return
        for kind in (SphereCollider, AABBCollider):
            if self.world.has_component(entity, kind):
                self.world.remove_component(entity, kind)
        if number % 3:
            self.world.add_component(entity, self.shape(ball, size))

    @rule(number=number, data=st.data())
    def give_or_take_body(self, number, data):
        entity = self.pick(number)
        if entity is None or entity in self.spoiled:
            return
        if self.world.has_component(entity, RigidBody):
            if any(self.world.has_component(entity, kind) for kind in (SphereCollider, AABBCollider)):
                self.world.remove_component(entity, RigidBody)
        elif number % 2:
            self.world.add_component(entity, RigidBody(linear_velocity=data.draw(vector(self.d))))

    # -- and change -------------------------------------------------------------------------------

    @rule(number=number, data=st.data())
    def teleport(self, number, data):
        entity = self.pick(number)
        if entity is not None:
            self.world.component_for_entity(entity, Transform).position = data.draw(vector(self.d))

    @rule(number=number, size=size)
    def resize(self, number, size):
        entity = self.pick(number, SphereCollider)
        if entity is not None:
            self.world.component_for_entity(entity, SphereCollider).radius = size

    @rule(
        number=number, layer=st.sampled_from(LAYERS), mask=st.sampled_from((-1, 1, 2)), sensor=st.booleans(),
        group=st.sampled_from((0, 0, 7, -7)), kind=st.sampled_from((AABBCollider, AABBCollider, SphereCollider)),
    )  # fmt: skip
    def change_filters(self, number, layer, mask, sensor, group, kind):
        entity = self.pick(number, kind)
        if entity is not None:
            collider = self.world.component_for_entity(entity, kind)
            collider.layer, collider.mask, collider.sensor, collider.group = layer, mask, sensor, group

    @rule(number=number, kind=kind)
    def change_kind(self, number, kind):
        entity = self.pick(number, RigidBody)
        if entity is not None and entity not in self.spoiled:
            self.world.component_for_entity(entity, RigidBody).kind = kind

    @rule(number=number)
    def spoil_or_mend(self, number):
        """With a velocity that cannot be it takes part in nothing, until the step after it is mended."""
        entity = self.pick(number, RigidBody)
        if entity is None:
            return
        velocity = self.world.bodies.linear_velocity[self.world.bodies.row_of(entity)]
        if entity in self.spoiled:
            velocity[:], self.spoiled[entity] = 0.0, MENDED
        elif self.world.component_for_entity(entity, RigidBody).kind == "dynamic" and number % 4 == 0:
            velocity[0], self.spoiled[entity] = math.nan, SPOILED

    @rule(
        mode=mode, dt=st.sampled_from((1 / 120, 1 / 60, 1 / 30)), substeps=st.sampled_from((1, 4)),
        gravity=st.sampled_from((0.0, GRAVITY)), sleeping=st.booleans(),
    )  # fmt: skip
    def change_settings(self, mode, dt, substeps, gravity, sleeping):
        self.world.settings = self.world.settings.replace(
            collision=mode, dt=dt, substeps=substeps, sleeping=sleeping
        )
        self.world.gravity = tuple(-gravity * (k == 1) for k in range(self.d))

    # -- steps --------------------------------------------------------------------------------------

    @rule(count=st.sampled_from((1, 2, 5, 20, 60, 300)))
    def step(self, count):
        for _ in range(count):
            self.world.step()
            self.check()

    def motions(self):
        """By entity, as bytes; static bodies, whose velocity becomes 0, have none."""
        bodies, found = self.world.bodies, {}
        for kind, rows in (("moves", bodies.dynamic), ("moves", bodies.kinematic), ("stands", bodies.static)):
            for entity, position, velocity in zip(
                rows.entity.tolist(), rows.position, rows.linear_velocity, strict=True
            ):
                found[entity] = position.tobytes() + (velocity.tobytes() if kind == "moves" else b"")
        return found

    @rule()
    def step_with_a_handler_that_raises(self):
        before, time = self.motions(), self.world.time
        self.raises = True
        try:
            self.world.step()
        except StepError as error:
            if not isinstance(error.__cause__, RaisedError):
                raise
            after = self.motions()  # whose deletion was asked for is gone
            assert self.world.time == time
            assert after == {entity: before[entity] for entity in after}
        else:
            self.check()
            begun = self.world.contacts.begin
            assert not len(begun), [(int(a), int(b)) for a, b in zip(begun.entity_a, begun.entity_b, strict=True)]
        finally:
            self.raises = False

    def check(self):
        """After a step."""
        Game.steps += 1
        self.spoiled = {entity: state for entity, state in self.spoiled.items() if state == SPOILED}
        contacts = self.world.contacts
        begin, end, now, impacts = map(pairs, (contacts.begin, contacts.end, contacts, contacts.impacts))
        assert len({*begin}) == len(begin)
        assert not self.touching & {*begin}
        assert {*end} <= self.touching
        self.touching = (self.touching | {*begin}) - {*end}
        assert self.touching == {*now}
        self.check_pairs({*impacts})
        self.check_table()

    def check_pairs(self, impacts):
        """Those that overlap are told; those that are apart are not, but for what has happened within the step."""
        solids = self.solids()
        of, near = {one.entity: one for one in solids}, set()
        if solids:
            centre, around = (np.array([getattr(one, name) for one in solids]) for name in ("centre", "around"))
            apart = (np.abs(centre[:, None] - centre) - around[:, None] - around).max(axis=2)
            near = {(solids[k].entity, solids[m].entity) for k, m in np.argwhere(np.triu(apart < 0, 1))}
        swept = self.world.settings.collision != "discrete"
        for pair in near | {pair for pair in self.touching if {*pair} <= {*of}}:
            a, b = (of[entity] for entity in pair)
            depth, least = a.depth(b), NEAR * min(a.size, b.size)
            dt, sensor = self.world.settings.dt, a.collider.sensor or b.collider.sensor
            moved = (a.speed + b.speed + 1.0) * dt  # pushed, after it was found that they touch
            if not a.may_meet(b):
                assert pair not in self.touching
            elif depth > least + moved:
                assert pair in self.touching, depth
            elif depth < -least - moved and pair in self.touching:
                assert pair in impacts or (swept and sensor), depth

    def check_table(self):
        """The bodies are those that esper has, and the columns what the components say."""
        bodies, world = self.world.bodies, self.world
        bodied = {*self.entities(RigidBody), *self.entities(SphereCollider), *self.entities(AABBCollider)}
        assert sorted(bodies.entity.tolist()) == sorted(bodied)
        fine = [row for row, entity in enumerate(bodies.entity.tolist()) if entity not in self.spoiled]
        assert np.isfinite(bodies.position[fine]).all()
        assert np.isfinite(bodies.linear_velocity[fine]).all()
        for row in fine:
            place = world.component_for_entity(int(bodies.entity[row]), Transform).position
            assert place.tolist() == bodies.position[row].tolist()

    # -- questions ----------------------------------------------------------------------------------

    @rule(data=st.data(), radius=st.sampled_from((0.0, 0.3, 2.0)))
    def query(self, data, radius):
        place = data.draw(vector(self.d))
        self.world.refresh_queries()
        solids = self.solids()
        depths = {one.entity: one.depth_of_ball(place, radius) for one in solids}
        self.compare(self.world.query_sphere(place, radius), depths)
        boxes = {
            one.entity: self.depth_in_box(one, place, radius + 0.1)
            for one in solids
        }
        self.compare(self.world.query_aabb(place - radius - 0.1, place + radius + 0.1), boxes)
        hit = self.world.query_nearest(place)
        if hit is not None and hit.entity in self.spoiled:
            return  # not known before the next step
        if depths:
            nearest = radius - max(depths.values())
            assert hit.distance == pytest.approx(nearest, abs=SURE)
        else:
            assert hit is None

    def depth_in_box(self, one, place, half):
        half = np.full(self.d, half)
        if one.is_ball:
            return sphere_box(one.centre, one.reach, place, half)[0]
        return box_depth(place, half, one.centre, one.reach)

    def compare(self, found, depths):
        assert found == sorted(found)
        for entity, depth in depths.items():
            assert abs(depth) < SURE or (entity in found) == (depth > 0), (entity, depth)
        assert {*found} - {*self.spoiled} <= {*depths}

    @rule(data=st.data(), radius=st.sampled_from((0.0, 0.3)))
    def cast(self, data, radius):
        """A ray or a ball: it touches what it hits where it hits it, and nothing before."""
        start, way = data.draw(vector(self.d)), 3.0 * data.draw(vector(self.d))
        length = float(np.linalg.norm(way))
        if length == 0.0:
            return
        self.world.refresh_queries()
        if radius:
            hits = self.world.shape_cast(SphereCollider(radius), start, way)
        else:
            hits = self.world.ray_cast(start, way, length)
        met = {hit.entity: hit.fraction for hit in hits if hit.entity not in self.spoiled}
        assert [hit.fraction for hit in hits] == sorted(hit.fraction for hit in hits)
        for one in self.solids():
            if radius and not one.collider.mask & 1:  # what passes a shape of the first layer
                assert one.entity not in met
                continue
            until = met.get(one.entity, 1.0)
            if one.entity in met:
                depth = one.depth_of_ball(start + until * way, radius)
                assert depth > -1e-8 if until == 0.0 else abs(depth) < 1e-7, (one.entity, depth)
            for share in np.linspace(0.0, until, 9)[: -1 if one.entity in met else None]:
                assert until == 0.0 or one.depth_of_ball(start + share * way, radius) < 1e-7, (one.entity, share)

    # -- back in time ---------------------------------------------------------------------------------

    @rule()
    def snapshot(self):
        self.keep(self.world.snapshot())

    @rule(number=number)
    def save(self, number):
        path = Path(self.folder.name) / str(number)
        self.world.save(path)
        self.kept = [one for one in self.kept if one[0] != path]
        self.keep(path)

    def keep(self, where):
        known = {*self.touching}, {**self.spoiled}
        self.kept = [*self.kept[-3:], (where, self.world.state_hash(), known)]

    @precondition(lambda self: self.kept)
    @rule(number=number)
    def go_back(self, number):
        where, was, (touching, spoiled) = self.kept[number % len(self.kept)]
        self.touching, self.spoiled = {*touching}, {**spoiled}
        if isinstance(where, Path):
            self.world.close()
            self.enter(World.load(where, Physics(self.d, self.gravity), components=[Health]))
            self.kept = [one for one in self.kept if isinstance(one[0], Path)]
        else:
            self.world.restore(where)
        assert self.world.state_hash() == was
        self.check_table()


def play(games, rules, **chosen):
    """Games of so many rules each, always the same ones."""
    run_state_machine_as_test(
        Game,
        settings=settings(
            max_examples=games, stateful_step_count=rules, deadline=None, database=None, derandomize=True,
            suppress_health_check=list(HealthCheck), **chosen,
        ),
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.compiled
def test_a_few_games():
    play(4, 30)


def play_for(steps):
    """Games until they have made so many steps: each round plays others, as its games are longer by a rule."""
    Game.steps, rules = 0, 50
    while Game.steps < steps:
        play(25, rules)
        rules += 1


@pytest.mark.slow
def test_games_of_some_hundred_steps():
    play_for(400)


@pytest.mark.long
def test_games_of_a_million_steps():
    play_for(1_000_000)
