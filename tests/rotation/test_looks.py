"""What turns is looked at as it is turned on its way; that it has been looked at changes nothing."""

from __future__ import annotations

import numpy as np
import pytest

from carom.components import RigidBody, Transform
from carom.components.spin import Spin
from carom.framework import World
from carom.framework.compilation import kernel
from carom.framework.jit.records.record_type import record_at
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation
from carom.systems.ccd.turning_touch import first_touch_of_turn
from carom.systems.records import STATE


@pytest.mark.parametrize("d", [2, 3])
def test_looking_for_touches_changes_no_bit(d):
    state_at = record_at(STATE, d)

    @kernel
    def look(address, dt):
        state, touches = state_at(address), 0
        for c in range(state.pairs.count):
            touches += first_touch_of_turn(state, dt, state.pairs.a[c], state.pairs.b[c])[0]
        return touches

    random, touches = np.random.default_rng(d), 0
    with World(Physics(d), Rotation()) as world:
        world.create_entity(Transform((0.0, -1.0, 0.0)[:d]), BoxCollider((9.0, 1.0, 9.0)[:d]))
        for _ in range(40):
            box = BoxCollider(random.uniform(0.1, 0.5, d), offset=random.uniform(-0.2, 0.2, d))
            spin = Spin(random.uniform(-20.0, 20.0) if d == 2 else random.uniform(-20.0, 20.0, 3))
            place = random.uniform((-3.0, 0.0, -3.0)[:d], (3.0, 3.0, 3.0)[:d])
            world.create_entity(Transform(place), RigidBody(), spin, box)
        for _ in range(20):
            world.step()
            state = world.physics.state
            seen = ("axes", "offset", "spin", "inverse_inertia", "inverse_products", "position", "turn")
            before = {name: np.array(getattr(state.bodies, name)) for name in seen}
            touches += look(state.address, 1 / 60)
            for name in seen:
                np.testing.assert_array_equal(getattr(state.bodies, name), before[name], name)
    assert touches > 100
