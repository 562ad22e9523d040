"""Heaps without friction: they come to rest and stay, no body escapes, overlap is small."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_rest import G, depths
from worlds import make_world

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework.errors import StepError
from carom.scenes import pile


@pytest.mark.parametrize("e", [0.3, *(pytest.param(e, marks=pytest.mark.slow) for e in (0.0, 0.8))])
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


@pytest.mark.parametrize(("dt", "published"), [(1e-2, 0.0161), pytest.param(1e-3, 1.55e-4, marks=pytest.mark.slow)])
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
