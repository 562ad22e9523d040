"""Maps of tiles that change: single cells, undo, snapshots, files, and what sleeps near them."""

from __future__ import annotations

import numpy as np
import pytest

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Phase, Settings, StepError, System, World
from carom.plugins import Physics, tile_grid
from carom.plugins.tile_grid import TileGridCollider, cells
from carom.plugins.tile_grid.cells import packed_of

POOL = TileGridCollider.columns["packed"].pool
FLOOR = np.zeros((40, 60), bool)
FLOOR[-3:] = True


def make_world(tiles=FLOOR, balls=(), **settings):
    """A map with its lower left corner at 0, and balls that lie on its floor at these x; world, map, balls."""
    world = World(Physics(dimensions=2, gravity=(0, -10)), tile_grid.plugin, settings=Settings(**settings))
    ground = world.create_entity(Transform((0, 0)), TileGridCollider(tiles, 1.0, lower=(0, 0)))
    entities = [
        world.create_entity(Transform((x, 3.4)), RigidBody(), SphereCollider(0.4, friction=0.5)) for x in balls
    ]
    return world, ground, entities


def tiles_of(world, ground):
    return world.component_for_entity(ground, TileGridCollider)


def height(world, entity):
    return world.component_for_entity(entity, Transform).y


def asleep(world, entities):
    return [world.component_for_entity(entity, RigidBody).asleep for entity in entities]


def run(world, steps):
    for _ in range(steps):
        world.step()


# -- the array ---------------------------------------------------------------------------------------------------------


@pytest.mark.plain
@pytest.mark.parametrize("shape", [(1, 1), (5, 40), (16, 32), (17, 33), (70, 50), (100, 100)])
def test_cells_one_by_one_make_the_same_map_as_all_at_once(shape):
    rng = np.random.default_rng(shape[0])
    tiles = rng.random(shape) < 0.4
    map_of_tiles = TileGridCollider(tiles, 0.5)
    for count in (1, 1, 1, 3, 20, 100, 5000):
        places = rng.integers((0, 0), shape, (count, 2))
        values = rng.random(count) < 0.5
        if count == 1:
            map_of_tiles.set(tuple(places[0].tolist()), bool(values[0]))
        else:
            map_of_tiles.set(places, values)
        for (row, column), value in zip(places, values, strict=True):  # the last value holds
            tiles[row, column] = value
        np.testing.assert_array_equal(map_of_tiles.cells, tiles)
        np.testing.assert_array_equal(map_of_tiles.packed[:, 0], packed_of(tiles))
        assert POOL.digests[map_of_tiles._values["packed"]] == POOL.digests[POOL.number_of(packed_of(tiles)[:, None])]


@pytest.mark.plain
def test_many_cells_take_one_value():
    drawn = TileGridCollider(FLOOR, 1.0)
    drawn.set([(0, 0), (39, 59), (5, 6)], 1)
    drawn.set(np.array(((39, 0), (38, 0))), False)
    expected = FLOOR.copy()
    expected[0, 0] = expected[5, 6] = True
    expected[[39, 38], 0] = False
    np.testing.assert_array_equal(drawn.cells, expected)
    for none, value in (([], True), ((), False), (np.array([]), 1), ([], []), (np.zeros((0, 2), int), True)):
        drawn.set(none, value)
        np.testing.assert_array_equal(drawn.cells, expected)
    drawn.set(np.argwhere(~expected), True)
    assert drawn.cells.all()


@pytest.mark.plain
@pytest.mark.parametrize(
    ("cell", "value", "rule"),
    [
        ((40, 0), True, "the map has 40 rows and 60 columns, got row 40, column 0"),
        ((0, -1), True, "the map has 40 rows and 60 columns, got row 0, column -1"),
        ([(0, 0), (3, 60)], True, "got row 3, column 60"),
        ((0.0, 1.0), True, r"cell must be \(row, column\), or several of them, of integers, got \(0.0, 1.0\)"),
        (3, True, "cell must be"), ((1, 2, 3), True, "cell must be"), ((True, False), True, "cell must be"),
        ("ab", True, "cell must be"), ([(1, 2), (3,)], True, "cell must be"),
        ((1, 2), 0.5, r"value must be True or False, or 1 of them, got 0\.5"), ((1, 2), None, "value must be"),
        ((1, 2), "#", "value must be"), ([(1, 2), (1, 3)], [True], "or 2 of them"), ((1, 2), [1, 0], "or 1 of them"),
        ((1, 2), [(1,), (1, 0)], "value must be"),
    ],
)  # fmt: skip
def test_wrong_cells_and_values_are_refused(cell, value, rule):
    world, ground, _ = make_world()
    world.step()
    for tiles, whose in ((TileGridCollider(FLOOR, 1.0), ""), (tiles_of(world, ground), f"entity {ground}: ")):
        with pytest.raises(ValueError, match=rule) as refused:
            tiles.set(cell, value)
        assert str(refused.value).startswith(f"{whose}TileGridCollider.set: ")
        np.testing.assert_array_equal(tiles.cells, FLOOR)
    with pytest.raises(ValueError, match="must be what TileGridCollider makes of cells"):
        tiles_of(world, ground).packed = np.array(tiles_of(world, ground).packed) + 1.0


@pytest.mark.plain
def test_what_shares_a_map_keeps_its_own():
    """Prefabs, copies, pairs of floors and walls, other worlds."""
    prefab = TileGridCollider(FLOOR, 1.0)
    worlds = [make_world()[0] for _ in range(2)]
    entities = [world.create_entity(Transform((0, 90)), prefab.copy()) for world in worlds]
    pair = [
        worlds[0].create_entity(Transform((0, 180)), part) for part in TileGridCollider.floors_and_walls(FLOOR, 1.0)
    ]
    many = TileGridCollider.many([prefab.packed] * 2, 1.0)
    made = worlds[1].create_entities(2, Transform.many([(0, 270), (0, 360)]), many)
    for world in worlds:
        world.step()
    tiles_of(worlds[0], entities[0]).set((0, 0), True)
    tiles_of(worlds[1], int(made[1])).set((1, 1), True)
    prefab.set((2, 2), True)
    for world in worlds:
        world.step()
    kept = [(worlds[1], entities[1]), (worlds[0], pair[0]), (worlds[0], pair[1]), (worlds[1], int(made[0]))]
    for world, entity in kept:
        np.testing.assert_array_equal(tiles_of(world, entity).cells, FLOOR)
    for tiles, cell in ((tiles_of(worlds[0], entities[0]), 0), (tiles_of(worlds[1], int(made[1])), 1), (prefab, 2)):
        assert np.argwhere(tiles.cells != FLOOR).tolist() == [[cell, cell]]


# -- in a world --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_step_goes_on_as_if_the_whole_map_had_been_assigned():
    """Among balls that roll and rest on it; the hashes are equal in each step."""
    rng = np.random.default_rng(3)
    worlds = [make_world(balls=np.arange(2.5, 58, 3.0)) for _ in range(3)]
    for world, _, balls in worlds:
        for entity in balls[::2]:
            world.component_for_entity(entity, RigidBody).linear_velocity = (3.0, 0.0)
    tiles = FLOOR.copy()
    for step in range(150):
        row, column, value = int(rng.integers(34, 40)), int(rng.integers(60)), bool(rng.random() < 0.4)
        tiles[row, column] = value
        (one, ground, _), (two, other, _), (three, third, _) = worlds
        tiles_of(one, ground).set((row, column), value)
        tiles_of(two, other).cells = tiles
        tiles_of(three, third).packed = packed_of(tiles)[:, None]
        if step % 10 == 0:  # another way to the same
            tiles_of(one, ground).set((0, 0), True)
            tiles_of(one, ground).set((0, 0), False)
        assert one.state_hash() == two.state_hash() == three.state_hash()
        for world, _, _ in worlds:
            world.step()
    assert one.state_hash() == two.state_hash() == three.state_hash()
    assert min(height(one, entity) for entity in worlds[0][2]) < 3.0  # some have fallen into holes


def test_only_the_map_is_read_again():
    """No body is looked at, and no box made, because of a cell; queries and steps see it at once."""
    world, ground, (ball,) = make_world(balls=[10.5])
    for k in range(30):
        world.create_entity(Transform((100.0 + 3 * k, 0)), AABBCollider(1.0))
    run(world, 30)
    table, state = world.physics.table, world.physics.state
    before = table.version, table.members_version, table.static_version, state.statics_version, state.motion_version
    tiles_of(world, ground).set((20, 30), True)
    assert before == (
        table.version, table.members_version, table.static_version, state.statics_version, state.motion_version
    )  # fmt: skip
    assert world.query_point((30.5, 19.5)) == [ground]
    world.step()
    assert before[3] == state.statics_version
    tiles_of(world, ground).set([(37, 10), (38, 10), (39, 10)], False)
    assert world.query_point((10.5, 2.5)) == []
    run(world, 60)
    assert height(world, ball) < 0


class Digs(System):
    """Makes cells tiles or empty at these steps; fails at one."""

    phase = Phase.START

    def __init__(self, ground, cells, fails=-1):
        self.ground, self.cells, self.fails = ground, cells, fails

    def process(self, dt):
        count = self.world.step_count
        if count in self.cells:
            self.world.component_for_entity(self.ground, TileGridCollider).set(*self.cells[count])
        if count == self.fails:
            self.fails = -1
            raise RuntimeError("no")


def test_a_system_digs_and_the_same_step_sees_it():
    """Also where the pool has to move for it; another world goes on with what it has."""
    world, ground, (ball,) = make_world(balls=[10.5])
    other, _, (same,) = make_world(balls=[10.5])
    hole = [(37, 10), (38, 10), (39, 10)]
    world.add_system(Digs(ground, {k: (hole, k % 2 == 0) for k in range(20, 81)}))
    run(other, 10)
    run(world, 81)
    assert height(world, ball) == pytest.approx(3.4, abs=0.01)  # a hole of one step in two
    world.add_system(Digs(ground, {81: (hole, False)}))
    world.step()
    assert world.contacts.of(ball) == []
    run(world, 60)
    assert height(world, ball) < 0
    run(other, 90)
    assert height(other, same) == pytest.approx(3.4, abs=1e-3)


def test_a_step_that_fails_puts_the_cell_back():
    world, ground, (ball,) = make_world(balls=[10.5])
    run(world, 30)
    hashed = world.state_hash()
    digs = Digs(ground, {30: ([(37, 10), (38, 10), (39, 10)], False)}, fails=30)
    world.add_system(digs)
    with pytest.raises(StepError):
        world.step()
    assert world.state_hash() == hashed
    np.testing.assert_array_equal(tiles_of(world, ground).cells, FLOOR)
    digs.cells = {}
    run(world, 30)
    assert height(world, ball) == pytest.approx(3.4, abs=1e-3)


def test_snapshots_and_files_hold_the_cells(tmp_path):
    world, ground, _ = make_world(balls=[10.5])
    run(world, 20)
    snapshots, hashes = [], []
    for k in range(40):
        tiles_of(world, ground).set((39 - k % 3, 10), k < 5)
        tiles_of(world, ground).set((k, k), True)
        snapshots.append(world.snapshot())
        hashes.append(world.state_hash())
        world.step()
    last = world.state_hash()
    world.save(tmp_path / "world.npz")
    for k in (0, 39, 7, 20):
        world.restore(snapshots[k])
        assert world.state_hash() == hashes[k]
        world.step()
        for more in range(k + 1, 40):
            tiles_of(world, ground).set((39 - more % 3, 10), more < 5)
            tiles_of(world, ground).set((more, more), True)
            world.step()
        assert world.state_hash() == last
    loaded = World.load(tmp_path / "world.npz", Physics(dimensions=2), tile_grid.plugin)
    assert loaded.state_hash() == last
    for each in (world, loaded):
        tiles_of(each, ground).set((20, 20), False)
        run(each, 5)
    assert loaded.state_hash() == world.state_hash()


# -- what sleeps -------------------------------------------------------------------------------------------------------

HOLE = [(37, 10), (38, 10), (39, 10)]
SPOTS = (10.5, 13.5, 30.5, 50.5)


def sleepers():
    world, ground, balls = make_world(balls=SPOTS, sleeping=True)
    run(world, 90)
    assert asleep(world, balls) == [True] * 4
    return world, ground, balls


@pytest.mark.slow
@pytest.mark.parametrize("how", ["set", "assigned", "in a system", "snapshot", "file", "fails first"])
def test_what_rests_on_a_tile_that_goes_falls_and_others_sleep_on(how, tmp_path):
    world, ground, balls = sleepers()
    if how == "in a system":
        world.add_system(Digs(ground, {90: (HOLE, False)}))
    elif how == "assigned":
        tiles = FLOOR.copy()
        tiles[37:, 10] = False
        tiles_of(world, ground).cells = tiles
    else:
        tiles_of(world, ground).set(HOLE, False)
    if how == "snapshot":
        snapshot = world.snapshot()
        run(world, 30)
        world.restore(snapshot)
    elif how == "file":
        world.save(tmp_path / "world.npz")
        world = World.load(tmp_path / "world.npz", Physics(dimensions=2), tile_grid.plugin)
    elif how == "fails first":
        world.add_system(Digs(ground, {}, fails=90))
        with pytest.raises(StepError):
            world.step()
        assert asleep(world, balls) == [True] * 4
    for _ in range(60):
        world.step()
        assert asleep(world, balls)[1:] == [True] * 3
    assert height(world, balls[0]) < 0
    world.create_entity(Transform((20.0, 20.0)), AABBCollider(0.1, mask=0))  # all is bound again: others sleep on
    run(world, 2)
    assert asleep(world, balls)[1:3] == [True] * 2


def test_a_tile_that_comes_into_a_sleeper_pushes_it_out():
    world, ground, balls = sleepers()
    tiles_of(world, ground).set((36, 30), True)
    run(world, 60)
    assert height(world, balls[2]) > 4.0 or abs(world.component_for_entity(balls[2], Transform).x - 30.5) > 0.8
    assert asleep(world, balls)[:2] == [True] * 2
    assert asleep(world, balls)[3]


def test_a_cell_that_is_so_already_wakes_nothing():
    world, ground, balls = sleepers()
    packed = world.physics.table.column("tile_grid_collider.packed").copy()
    tiles_of(world, ground).set(HOLE, True)
    tiles_of(world, ground).cells = FLOOR
    np.testing.assert_array_equal(world.physics.table.column("tile_grid_collider.packed"), packed)
    run(world, 3)
    assert asleep(world, balls) == [True] * 4


def test_a_far_change_wakes_nothing_for_a_long_time():
    """Every step another cell, and other changes that have all that is watched bound again."""
    world, ground, balls = sleepers()
    for k in range(60):
        tiles_of(world, ground).set((k % 20, k % 60), k % 3 > 0)
        if k % 10 == 0:
            world.create_entity(Transform((20.0 + k / 10, 20.0)), SphereCollider(0.1, mask=0))
        if k == 33:
            world.restore(world.snapshot())
        world.step()
        assert asleep(world, balls) == [True] * 4


# -- room --------------------------------------------------------------------------------------------------------------


@pytest.mark.plain
def test_a_change_digests_a_part_of_a_large_map(monkeypatch):
    drawn = TileGridCollider(np.zeros((300, 300), bool), 1.0)
    digested = []
    parts_of = POOL._parts_of

    def count(array, rows):
        digested.extend(rows)
        return parts_of(array, rows)

    monkeypatch.setattr(POOL, "_parts_of", count)
    for k in range(50):
        drawn.set((6 * k, 5 * k), True)
    assert len(digested) == 50
    assert drawn.cells.sum() == 50


@pytest.mark.plain
def test_room_for_a_map():
    """Bits, and sums over blocks: less than half a byte a cell, where a sum for each took eight."""
    assert cells.packed_of(np.zeros((1000, 1000), bool)).nbytes / 1e6 < 0.3
    assert cells.packed_of(np.zeros((50, 200), bool)).nbytes / 1e4 < 0.4
