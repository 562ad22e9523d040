"""Laws of piles, heaps and bins: they come to rest and stay, lose no body, and overlap little."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import pytest
from helpers_pairwise import pairwise
from helpers_rest import G, depths
from laws.helpers_laws import MODES, fastest, root_mean_square, seeds
from worlds import ball, box, make_world

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import StepError
from carom.scenes import pile

pytestmark = pytest.mark.early


class Pile(NamedTuple):
    """Greatest speed, and root mean square of all, over the last two seconds, m/s; bodies outside; the energy that all
    steps of the last two seconds have risen by together, J."""

    fastest: float
    rms: float
    out: int
    gained: float


def heap(seed, mode, columns, rows, e, friction, *, seconds, maker=ball):
    """Discs of .3 to .5 m and 1 kg in columns with gaps between them fall into a bin and come to rest.

    Each contact and its friction take energy: at rest, what the steps add is only rounding.
    """
    random = np.random.default_rng([seed, 6])
    half = 0.5 * 1.15 * columns + 0.1
    with make_world(2, G, collision=mode, on_fault="ignore") as world:
        box(world, (0.0, -1.0), half=(half + 2.0, 1.0), kind="static", friction=friction)
        for side in (-1.0, 1.0):
            box(world, (side * (half + 1.0), 40.0), half=(1.0, 80.0), kind="static", friction=friction)
        for k in range(columns * rows):
            place = ((k % columns) * 1.15 - half + 0.6 + random.uniform(-0.05, 0.05), 1.0 + (k // columns) * 1.15)
            size = random.uniform(0.3, 0.5)
            size = {"radius": size} if maker is ball else {"half": size}
            maker(world, place, restitution=e, friction=friction, **size)
        last = rms = gained = 0.0
        for step in range(seconds * 60):
            before = world.kinetic_energy() + world.potential_energy()
            world.step()
            if step >= (seconds - 2) * 60:
                last, rms = max(last, fastest(world)), max(rms, root_mean_square(world))
                gained += max(0.0, world.kinetic_energy() + world.potential_energy() - before)
        place = world.bodies.dynamic.position
        inside = (np.abs(place[:, 0]) < half) & (place[:, 1] > 0.0)
        return Pile(last, rms, int((~inside).sum()), gained)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", seeds(1, 12))
def test_equal_discs_that_lean_on_friction_come_to_rest(seed, mode):
    """300 discs of e .2 and friction .4, after twelve seconds: each column of thirty sways, see test_stacks."""
    found = heap(seed, mode, 10, 30, 0.2, 0.4, seconds=12)
    assert found.fastest < 1e-5
    assert found.out == 0


@pytest.mark.long
@pytest.mark.parametrize("mode", ["discrete", "continuous"])
@pytest.mark.parametrize("seed", range(4))
def test_a_thousand_discs_come_to_rest(seed, mode):
    """After half a minute."""
    found = heap(seed, mode, 20, 50, 0.2, 0.4, seconds=30)
    assert found.rms < 1e-3
    assert found.out == 0


@pytest.mark.long
@pytest.mark.parametrize("maker", [ball, box])
@pytest.mark.parametrize(
    ("seed", "mode", "e", "friction"), list(itertools.product(range(2), MODES, (0.0, 0.5), (0.0, 0.2, 0.8)))
)
def test_small_piles_of_any_material_come_to_rest(seed, mode, e, friction, maker):
    """Forty bodies, after ten seconds. Without friction some go on sliding, but no contact gives them energy."""
    found = heap(seed, mode, 5, 8, e, friction, seconds=10, maker=maker)
    assert found.out == 0
    if friction:
        assert found.fastest < 1e-3


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_ten_thousand_discs_come_to_rest(seed):
    """At step 900 none is out, and the deepest overlap is a twentieth. Layers without friction may slide as late as
    that, as weight moves them (seed 2: 96 J at step 840): at step 1200 less than 1 J of kinetic energy is left."""
    with scenes.pile2d.build(n=10_000, seed=seed) as world:
        for _ in range(900):
            world.step()
        place = world.bodies.dynamic.position
        assert ((place[:, 0] > 0) & (place[:, 0] < 120.0) & (place[:, 1] > 0)).all()
        assert depths(world).max() < 0.05
        for _ in range(300):
            world.step()
        assert world.kinetic_energy() < 1.0


# -- without friction, as published -------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.8, *(pytest.param(e, marks=pytest.mark.long) for e in (0.3, 0.0))])
def test_a_pile_of_a_thousand(e):
    """After 15 to 20 s all is at rest except single discs: mean overlap 0.2 %, greatest 2 % of a diameter."""
    with scenes.pile2d.build(n=1000) as world:
        dynamic, energies = world.bodies.dynamic, []
        dynamic.sphere_collider.restitution[:] = e
        for step in range(1200):
            world.step()
            if step >= 900 and step % 6 == 0:
                energies.append(world.kinetic_energy())
        overlap, (x, y) = depths(world), world.bodies.dynamic.position.T
        assert np.median(energies) < 1e-6 * 1000 * dynamic.mass[0] * G
        assert overlap.mean() < 0.002
        assert overlap.max() < 0.02
        assert ((x >= 0) & (x <= pile.width(1000, 2)) & (y >= 0)).all()


@pytest.mark.slow
@pytest.mark.parametrize(("dt", "published"), [(1e-2, 0.0161), pytest.param(1e-3, 1.55e-4, marks=pytest.mark.long)])
@pytest.mark.parametrize(("shape", "pitch"), [((7, 7, 1), 2.0), ((6, 6, 6), 0.201), ((6, 6, 6), 2.0)])
def test_published_lattice_666(shape, pitch, dt, published):
    """A3: spheres R = 0.1, 10 kg, e = 0, 10 s, lowest centre at 0.101: mean squared overlap, m^2, below ODE's."""
    world = make_world(3, gravity=(0.0, 0.0, -G), dt=dt)
    world.create_entity(Transform((0, 0, -1)), AABBCollider((100, 100, 1)))
    centres = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, 3) * pitch + (0, 0, 0.101)
    world.create_entities(
        len(centres), Transform.many(centres), RigidBody.many(mass=10.0), SphereCollider.many(radius=0.1)
    )
    squares = []
    for _ in range(round(10 / dt)):
        world.step()
        squares.append((depths(world) ** 2).sum())
    assert np.mean(squares) < published
    assert world.kinetic_energy() < 1e-9


@pytest.mark.parametrize("side", [0.0, 10.0])
def test_more_pairs_than_memory_are_refused(side):
    """C3, C19 with 3e4 bodies: 4.5e8 and 1.4e7 candidate pairs are not stored; the error states the number, no body
    moves."""
    world = make_world(3)
    before = np.random.default_rng(1).uniform(0, side, (30_000, 3))
    world.create_entities(len(before), Transform.many(before), RigidBody.many(), SphereCollider.many(radius=0.5))
    with pytest.raises(StepError, match="candidate pairs exceed the limit"):
        world.step()
    assert (world.bodies.position == before).all()


# -- bins: light things and a few heavy ones ----------------------------------------------------------

HALF, LIGHT = 5.0, 150
RESTITUTIONS = (0.0, 0.2, 0.5)
HEAVY = (20.0, 100.0, 1000.0)  # kg, each of three
REST = 1e-3  # m/s


class Bin(NamedTuple):
    """Greatest speed of a body in the last two seconds, m/s; bodies beyond the inner faces of the bin by a radius."""

    fastest: float
    out: int


def settle(seed, mode, e, heavy, *, seconds=25):
    """A hundred and fifty discs and boxes of 1 kg, then three balls of ``heavy`` kg, fall into a bin with friction.

    Contacts take energy and friction holds what lies on slopes: the bin comes to rest, whatever the masses.
    """
    random = np.random.default_rng([seed, 2])
    with make_world(2, G, collision=mode, on_fault="ignore") as world:
        box(world, (0.0, -1.0), half=(8.0, 1.0), kind="static", friction=0.4)
        for side in (-1.0, 1.0):
            box(world, (side * (HALF + 1.0), 10.0), half=(1.0, 20.0), kind="static")
        for k in range(LIGHT):
            place = ((k % 8) * 1.15 - 4.0 + random.uniform(-0.05, 0.05), 1.0 + (k // 8) * 1.15)
            if k % 2:
                ball(world, place, radius=0.45, restitution=e, friction=0.4)
            else:
                box(world, place, half=0.45, restitution=e, friction=0.4)
        for k in range(3):
            place = (3.0 * (k - 1), 3.0 + (LIGHT // 8) * 1.15)
            ball(world, place, radius=0.6, mass=heavy, restitution=e, friction=0.4)
        last = 0.0
        for step in range(seconds * 60):
            world.step()
            if step >= (seconds - 2) * 60:
                last = max(last, fastest(world))
        place = world.bodies.dynamic.position
        inside = (np.abs(place[:, 0]) < HALF + 0.5) & (place[:, 1] > -0.5)
        return Bin(last, int((~inside).sum()))


def check_bin(found):
    assert found.out == 0
    assert found.fastest < REST


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "e", "heavy"), pairwise(MODES, RESTITUTIONS, HEAVY))
def test_bins_come_to_rest(mode, e, heavy):
    check_bin(settle(0, mode, e, heavy))


@pytest.mark.long
@pytest.mark.parametrize(
    ("seed", "mode", "e", "heavy"), list(itertools.product(range(1, 7), MODES, RESTITUTIONS, HEAVY))
)
def test_every_bin_comes_to_rest(seed, mode, e, heavy):
    check_bin(settle(seed, mode, e, heavy))
