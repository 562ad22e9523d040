"""Equal ids, equal bits: facade or plain esper, repeated runs; other processes: test_checked_build."""

from __future__ import annotations

import esper
import numpy as np
import pytest
from helpers_determinism import STEPS, Facade, mixed_scene, settled, state


class Plain:
    """esper's own functions, inside ``with world:``."""

    def __init__(self, world):
        self.world = world

    FUNCTIONS = {  # noqa: RUF012
        "create": esper.create_entity,
        "delete": esper.delete_entity,
        "add": esper.add_component,
        "remove": esper.remove_component,
    }

    def __getattr__(self, name):
        function = self.FUNCTIONS[name]

        def call(*args, **kwargs):
            with self.world:
                return function(*args, **kwargs)

        return call

    def step(self):
        with self.world:
            esper.process(self.world.settings.dt)


@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "rk4"])
def test_plain_esper_gives_the_same_bits_as_the_facade(integrator):
    worlds = [settled(integrator=integrator) for _ in range(2)]
    scenes = [mixed_scene(world, use(world)) for world, use in zip(worlds, (Facade, Plain), strict=True)]
    contacts = 0
    for _ in zip(*scenes, strict=True):
        assert state(worlds[0]) == state(worlds[1])
        assert worlds[0].state_hash() == worlds[1].state_hash()
        contacts += len(worlds[0].contacts.impacts)
    assert worlds[0].step_count == STEPS
    assert contacts > 50  # there was something to compare
    assert np.isfinite(worlds[0].bodies.position).all()


def test_repeated_runs_are_equal():
    def run():
        world = settled()
        for _ in mixed_scene(world, Facade(world)):
            pass
        return state(world)

    assert run() == run()
