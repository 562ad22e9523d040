"""The benchmark scenes against their definition: every number from a plain loop, body by body."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from helpers_scenes import published_numbers

from carom import scenes
from carom.components import AABBCollider, SphereCollider
from carom.framework import Phase
from carom.scenes.sizes import ceil_root, floor_root

GENERATORS = ["gas2d", "gas3d", "mixed2d", "fastgas", "pile2d", "pile3d", "static_world", "freefall", "player_query"]
CIRCLE, SPHERE = math.pi / 4, math.pi / 6


def make(name, **options):
    return getattr(scenes, name).build(**options)


def gas(n, dimensions, seed=0):
    """Lists of positions and velocities."""
    side = math.sqrt(n * math.pi) if dimensions == 2 else (n * SPHERE / 0.1) ** (1 / 3)
    cells = next(m for m in itertools.count(1) if m**dimensions >= n)
    s = side / cells
    a = 0.45 * (s - 1)
    u = published_numbers(seed)
    positions, velocities = [], []
    for k in range(n):
        cell = [k % cells, k // cells % cells, k // cells**2][:dimensions]
        positions.append([(c + 0.5) * s + a * (2 * next(u) - 1) for c in cell])
        velocities.append([-5 + 10 * next(u) for _ in range(dimensions)])
    return np.array(positions), np.array(velocities)


def assert_bodies(world, positions, velocities, masses):
    """The dynamic bodies, in the order of their ids; the same numbers up to the rounding of other formulas."""
    dynamic = world.bodies.dynamic
    assert np.all(np.diff(dynamic.entity) > 0)
    np.testing.assert_allclose(dynamic.position, positions, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(dynamic.linear_velocity, velocities, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(dynamic.mass, masses, rtol=1e-15)


def material(world, entity):
    """(radius or half extents, restitution, friction) of an entity's one collider."""
    for kind, size in ((SphereCollider, "radius"), (AABBCollider, "half_extents")):
        collider = world.try_component(entity, kind)
        if collider is not None:
            return np.ravel(getattr(collider, size)).tolist(), collider.restitution, collider.friction
    raise AssertionError(f"entity {entity} has no collider")


@pytest.mark.parametrize(("n", "seed"), [(1, 0), (10, 0), (1000, 0), (1001, 3)])
@pytest.mark.parametrize(("name", "dimensions"), [("gas2d", 2), ("gas3d", 3)])
def test_gas(name, dimensions, n, seed):
    with make(name, n=n, seed=seed) as world:
        assert_bodies(world, *gas(n, dimensions, seed), CIRCLE if dimensions == 2 else SPHERE)
        assert material(world, world.bodies.dynamic.entity[0]) == ([0.5], 1.0, None)
        assert not np.any(world.gravity)


@pytest.mark.parametrize(("n", "seed"), [(1, 0), (10, 2), (1000, 0), (1024, 0)])
def test_pile2d(n, seed):
    width, per_row, u = 1.2 * math.sqrt(n), math.isqrt(n), published_numbers(seed)
    positions = []
    for k in range(n):
        i, j = k % per_row, k // per_row
        x = width / 2 + (i - (per_row - 1) / 2) * 1.2 + 0.09 * (2 * next(u) - 1)
        positions.append((x, 0.6 + 1.2 * j + 0.09 * (2 * next(u) - 1)))
    with make("pile2d", n=n, seed=seed) as world:
        assert_bodies(world, positions, np.zeros((n, 2)), CIRCLE)
        assert material(world, world.bodies.dynamic.entity[0]) == ([0.5], 0.0, None)
        assert world.gravity.tolist() == [0.0, -9.81]


@pytest.mark.parametrize(
    ("name", "side", "thickness", "sides"),
    [
        ("gas3d", (300 * SPHERE / 0.1) ** (1 / 3), 1.0, 6),
        ("fastgas", math.sqrt(300 * math.pi), 0.2, 4),
        ("pile2d", 1.2 * math.sqrt(300), 1.0, 3),
        ("pile3d", 1.2 * 300 ** (1 / 3), 1.0, 5),
    ],
)
def test_walls_stand_on_the_edge_and_overlap_in_the_corners(name, side, thickness, sides):
    with make(name, n=300) as world:
        static = world.bodies.static
        assert len(static) == sides
        half = np.array([material(world, entity)[0] for entity in static.entity])
        restitution = {material(world, entity)[1] for entity in static.entity}
        assert restitution == {0.0 if "pile" in name else 1.0}
        lower, upper = static.position - half, static.position + half
        normal = half.argmin(axis=1)
        for axis in range(world.dimensions):
            faces = [(lower[w, axis], upper[w, axis]) for w in np.flatnonzero(normal == axis)]
            expected = [(-thickness, 0.0)]
            if not ("pile" in name and axis == 1):
                expected.append((side, side + thickness))
            np.testing.assert_allclose(sorted(faces), expected, rtol=1e-13, atol=1e-13)
        for a, b in itertools.combinations(range(sides), 2):
            if normal[a] != normal[b]:  # neighbours: common to both is more than an edge
                common = np.minimum(upper[a], upper[b]) - np.maximum(lower[a], lower[b])
                assert common.min() > 0.99 * thickness


SMALL = {name: {"n": 400} for name in (*GENERATORS, "maze", "platforms")} | {"pyramid": {"rows": 12}}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", sorted({*scenes.names()} - {"rubble", "tumbler"}))
def test_nothing_overlaps_at_the_start(name, seed):
    """A body that stands on another touches it: a gap of 0, to rounding."""
    with make(name, seed=seed, **SMALL.get(name, {})) as world:
        world.run(Phase.NARROW)
        assert world.contacts.depth.max(initial=0.0) < 1e-12


@pytest.mark.parametrize("name", [*GENERATORS, "maze", "platforms", "conveyor", "stack"])
def test_a_bad_number_of_bodies_is_refused(name):
    with pytest.raises(ValueError, match=r"^n must be at least 1, got 0$"):
        make(name, n=0)
    for n in (2.5, True):
        with pytest.raises(TypeError, match=f"^n must be a whole number, got {n}$"):
            make(name, n=n)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("pyramid", {"rows": 0}, "rows must be at least 1, got 0"),
        ("pyramid", {"spacing": 0.9}, "spacing must be at least 1, got 0.9"),
        ("stack", {"top_mass": 0.0}, "top_mass must be above 0, got 0.0"),
        ("cradle", {"gap": -0.1}, "gap must be at least 0, got -0.1"),
        ("cradle", {"arriving": (5,)}, "arriving must leave one of the 5 balls at rest, got 5"),
        ("lift", {"crates": -1}, "crates must be at least 0, got -1"),
        ("spring", {"damping": math.inf}, "damping must be at least 0, got inf"),
        ("orbit", {"eccentricity": 1}, "eccentricity must be below 1, got 1"),
        ("bouncing", {"height": 0.05}, "height must be at least 0.1, got 0.05"),
        ("thermal_gas", {"n": 1}, "n must be at least 4, got 1"),
        ("thermal_gas", {"n": 401}, "n must be a square number, got 401"),
        ("thermal_gas", {"eta": 0.8}, "eta must be at most pi / 4, where the discs of the lattice touch, got 0.8"),
    ],
)
def test_bad_options_are_refused(name, options, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        make(name, **options)


def test_roots_of_whole_numbers_are_exact():
    for degree in (2, 3):
        for m in (1, 2, 10, 99, 1000, 12345):
            assert floor_root(m**degree, degree) == ceil_root(m**degree, degree) == m
            assert (floor_root(m**degree + 1, degree), ceil_root(m**degree + 1, degree)) == (m, m + 1)
            assert ceil_root(m**degree - 1, degree) == (m if m > 1 else 0)
