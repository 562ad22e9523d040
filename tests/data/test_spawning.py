"""What it takes when bodies come and go: work for those alone, not for all that stay. Work is counted, not timed."""

import numpy as np
import pytest
from worlds import both_dimensions

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.framework.data.adoption import Adoption
from carom.framework.data.row_moves import MovedColumns, RowPlan
from carom.framework.schedule.stages import Program
from carom.plugins import Physics
from carom.systems.scene import Scene

STATICS = 400  # enough for a grid of their own
ROOM = 12.0  # m


class Level:
    """A world of many static boxes and a few spheres that move among them."""

    def __init__(self, dimensions, size=0.2):
        self.random = np.random.default_rng(1)
        self.world = World(Physics(dimensions=dimensions))
        places = self.random.uniform(0.0, ROOM, (STATICS, dimensions))
        half = self.random.uniform(0.5 * size, size, (STATICS, dimensions))
        self.statics = self.world.create_entities(
            STATICS, Transform.many(places), RigidBody.many(kind="static"), AABBCollider.many(half)
        )
        self.ids = [self.spawn() for _ in range(5)]
        self.world.step()
        self.ids.append(self.spawn())  # makes room for as many bodies again
        self.world.step()

    def spawn(self, kind="dynamic"):
        place = tuple(self.random.uniform(0.0, ROOM, self.world.dimensions))
        return self.world.create_entity(Transform(place), RigidBody(kind=kind), SphereCollider(radius=0.4))

    def change(self, step):
        """Somebody comes, in some steps somebody goes."""
        self.ids.append(self.spawn("kinematic" if step % 3 == 1 else "dynamic"))
        if step % 4 == 3:
            self.world.delete_entity(self.ids.pop(step % len(self.ids)))

    def seen(self):
        """All that may differ."""
        world = self.world
        contacts = [(c.entity_a, c.entity_b, c.depth) for c in world.contacts]
        return world.state_hash(), contacts, sorted(world.query_sphere([0.5 * ROOM] * world.dimensions, 2.0))


@both_dimensions
@pytest.mark.parametrize("size", [0.2, 3.0], ids=["grid", "uneven"])
def test_what_is_kept_of_those_that_stay_is_what_would_be_made_again(d, size):
    kept, again = Level(d, size), Level(d, size)
    for step in range(20):
        for level in (kept, again):
            level.change(step)
            if step == 9:  # another order of rows
                level.world.component_for_entity(level.ids[2], RigidBody).kind = "static"
            if step == 13:
                level.world.delete_entity(level.statics[7])
        again.world.physics.scene.forget()
        kept.world.step()
        again.world.step()
        assert kept.seen() == again.seen()
    assert kept.world.contacts


@both_dimensions
def test_static_bodies_are_not_boxed_or_placed_again_for_others(d):
    level = Level(d)
    state = level.world.physics.state
    before = state.statics_version, state.static_grid.version
    for step in range(12):
        level.change(step)
        level.world.step()
        assert (state.statics_version, state.static_grid.version) == before
    level.spawn("static")
    level.world.step()
    assert state.statics_version > before[0]


def test_a_spawn_adopts_one_body_and_neither_builds_the_scene_nor_links_stages(monkeypatch):
    level = Level(2)
    calls = []

    def count(cls, name, of):
        method = getattr(cls, name)

        def counted(self, *args):
            calls.append((name, of(*args)))
            return method(self, *args)

        monkeypatch.setattr(cls, name, counted)

    count(Scene, "_build", lambda *_: 0)
    count(Program, "link", lambda *_: 0)
    count(Adoption, "_adopt", lambda component, handles, sources: len(handles))
    for _ in range(3):
        level.spawn()
        level.world.step()
    assert calls == 9 * [("_adopt", 1)]


@pytest.mark.parametrize("seed", range(40))
def test_rows_move_as_in_a_list(seed):
    """Bodies of three kinds leave and come; columns of several types follow, also those that are moved later."""
    random = np.random.default_rng(seed)
    count, coming = int(random.integers(0, 30)), int(random.integers(0, 20))
    ids = np.zeros(80, np.int64)
    chosen = random.permutation(100)
    kinds, added_kinds = np.sort(random.integers(0, 3, count)), np.sort(random.integers(0, 3, coming))
    ids[:count], added = chosen[:count], chosen[count : count + coming]
    for kind in range(3):
        ids[:count][kinds == kind] = np.sort(ids[:count][kinds == kind])
        added[added_kinds == kind] = np.sort(added[added_kinds == kind])
    removed = np.flatnonzero(random.random(count) < random.random())
    stay = np.setdiff1d(np.arange(count), removed)
    bodies = [(kinds[row], ids[row], row) for row in stay.tolist()]
    bodies += [(kind, entity, -1) for kind, entity in zip(added_kinds, added, strict=True)]
    expected = [row for _, _, row in sorted(bodies)]

    numbers = np.arange(80.0)
    vectors, flags = np.stack((numbers, -numbers), axis=1), np.arange(80, dtype=np.int8)
    plan, first, second = RowPlan(), MovedColumns(), MovedColumns()
    plan.record.stops[:] = kinds.searchsorted((1, 2, 3))
    plan.begin(ids, removed, added, added_kinds)
    first.bind([numbers, flags], [np.array([-1.0]), None])
    first.move(plan)
    second.bind([vectors], [np.array([[-1.0, 1.0]])])
    second.move(plan)
    assert numbers[: len(expected)].tolist() == expected
    assert vectors[: len(expected)].tolist() == [[row, -row] for row in expected]
    assert plan.fresh.tolist() == [at for at, row in enumerate(expected) if row == -1]
    assert plan.record.stops.tolist() == [sum(kind < stop for kind, _, _ in bodies) for stop in (1, 2, 3)]
    stays = [at for at, row in enumerate(expected) if row != -1]
    assert flags[stays].tolist() == [expected[at] for at in stays]
