"""Physics of the scenes: stacks stand, loads are carried, counts are right."""

from __future__ import annotations

import numpy as np

from carom.components import AABBCollider
from carom.scenes import conveyor, lift, platforms

G = 9.81
SLOP = 0.005  # of a size: overlap that the solver does not correct


def steps(world, seconds):
    for _ in range(round(seconds / world.settings.dt)):
        world.step()


def kinetic_energy_per_body(world):
    """Kinetic energy per body in units of m g d: the height, in diameters, that it could lift a body."""
    dynamic = world.bodies.dynamic
    return 0.5 * (np.asarray(dynamic.linear_velocity) ** 2).sum(axis=1).mean() / G


def solid_depths(world):
    return np.maximum(np.asarray(world.contacts.depth), 0.0)


def test_crates_come_to_rest_on_the_platforms():
    with platforms.build() as world:
        steps(world, 10.0)
        position = world.bodies.dynamic.position
        assert kinetic_energy_per_body(world) < 1e-4
        assert solid_depths(world).mean() < 0.02
        assert ((position[:, 0] > 0) & (position[:, 0] < platforms.WIDTH) & (position[:, 1] > 0)).all()
        x, y = position.T
        for start, end, height in platforms.PLATFORMS:  # no centre inside one, and a crate on each
            assert not ((x > start) & (x < end) & (y > height - platforms.THICKNESS) & (y < height)).any()
            assert ((x > start) & (x < end) & (y > height) & (y < height + 2)).any()


def test_the_lift_and_the_ferry_take_their_crates_along():
    """Each crate keeps its place on its carrier to a twentieth of its size, under 0.75 to 1.25 of its weight."""
    with lift.build() as world:
        steps(world, 0.5)
        offsets = []
        for _ in range(round(1.5 * lift.LIFT_PERIOD * 60)):
            world.step()
            lifted, ferried = world.bodies.kinematic.position
            crates = world.bodies.dynamic.position
            offsets.append(np.concatenate([crates[:3] - lifted, crates[3:] - ferried]))
        offsets = np.array(offsets)
        assert np.ptp(offsets, axis=0).max() < 0.05
        np.testing.assert_array_equal(offsets[:, :3, 0], 0.0)
        np.testing.assert_allclose(
            offsets[0, :, 1], lift.THICKNESS / 2 + 0.5 + np.array([0, 1, 2, 0]), rtol=0, atol=4 * 1.25 * SLOP
        )


def test_the_conveyor_brings_every_crate_to_the_bin():
    """A crate reaches the belt's speed within v / (mu g) = 0.34 s of its landing and keeps it to the end."""
    with conveyor.build() as world:
        riding = []
        for _ in range(25 * 60):
            world.step()
            dynamic = world.bodies.dynamic
            x, y = dynamic.position.T
            rides = (x > conveyor.DROP[1][0] + 3.0) & (x < conveyor.LENGTH - 3.0) & (y > 0)
            riding += dynamic.linear_velocity[rides, 0].tolist()
        assert len(riding) > 1000
        np.testing.assert_allclose(riding, conveyor.SPEED, rtol=0, atol=0.05)
        position = world.bodies.dynamic.position
        half = np.array(
            [world.component_for_entity(int(crate), AABBCollider).half_extents for crate in world.bodies.dynamic.entity]
        )
        assert len(position) == conveyor.CRATES
        assert (position[:, 0] - half[:, 0] > conveyor.BIN[0] - 0.02).all()
        assert (position[:, 0] + half[:, 0] < conveyor.BIN[1] + 0.02).all()
        assert (position[:, 1] < 0).all()
        assert np.abs(world.bodies.dynamic.linear_velocity[:, 1]).max() < 1e-3  # on the slick floor some still slide
