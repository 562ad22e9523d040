"""What happens far away changes nothing here."""

from __future__ import annotations

import pytest
from rotation.helpers_turning import G, box, motion, pose, turning_world, wall
from worlds import MODES

from carom.components import AABBCollider, RigidBody, Transform
from carom.plugins.rotation import BoxCollider, Spin

FAR = 500.0  # m


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
def test_a_belt_elsewhere_turns_nothing_that_lands_flat(d, mode):
    """Where some surface ran all rows were solved one by one, and a box that fell 1.7 m spun at up to 2.5 rad/s."""
    with turning_world(d, G, collision=mode) as world:
        wall(world, (0.0, -1.0, 0.0)[:d], (9.0, 1.0, 9.0)[:d], friction=0.5)
        belt = AABBCollider((9.0, 1.0, 9.0)[:d], friction=0.5, surface_velocity=(0.5, 0.0, 0.0)[:d])
        world.create_entity(Transform((FAR, -1.0, 0.0)[:d]), belt)
        box(world, (FAR, 0.5, 0.0)[:d], (0.5, 0.5, 0.5)[:d], friction=0.5)
        falling = box(world, (0.0, 2.2, 0.0)[:d], (0.5, 0.5, 0.5)[:d], friction=0.5)
        most = 0.0
        for _ in range(120):
            world.step()
            spin = motion(world, falling)[1]
            most = max(most, abs(spin) if d == 2 else float(abs(spin).max()))
        assert most == 0.0 if d == 2 else most < 1e-12


@pytest.mark.parametrize("turns", [False, True])
def test_a_tower_sinks_no_more_because_a_box_that_turns_lies_elsewhere(turns):
    """Ten boxes that do not turn sank by 27 mm in place of 7 while one that does lay 500 m away."""
    with turning_world(2, 10.0) as world:
        for x in (0.0, FAR):
            wall(world, (x, -1.0), (9.0, 1.0))
        tower = [
            world.create_entity(Transform((0.0, 0.5 + k)), RigidBody(), AABBCollider((0.5, 0.5))) for k in range(10)
        ]
        world.create_entity(
            Transform((FAR, 0.5)), RigidBody(), BoxCollider((0.5, 0.5)), *((Spin(),) if turns else ())
        )
        for _ in range(600):
            world.step()
        assert 9.5 - pose(world, tower[-1])[1] == pytest.approx(0.00704, abs=1e-5)
