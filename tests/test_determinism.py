"""Equal ids, equal bits: facade or plain esper, repeated runs, other processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import esper
import numpy as np
import pytest
from helpers_determinism import Charge, settled, state

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem

STEPS = 220


class Swirl(ForceSystem):
    requires = (Charge,)

    def add_forces(self, bodies, time):
        bodies.force[:, 0] -= bodies.charge.value * bodies.position[:, 1]
        bodies.force[:, 1] += bodies.charge.value * np.sin(time)


class Facade:
    """The verbs of a world."""

    def __init__(self, world):
        self.world = world
        self.create, self.delete, self.add, self.remove = (
            world.create_entity, world.delete_entity, world.add_component, world.remove_component,
        )  # fmt: skip

    def step(self):
        self.world.step()


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


def mixed_scene(world, use):
    """Spheres and boxes thrown at each other over a floor, with creation and deletion; yields after each step."""
    world.add_system(Swirl())
    rng = np.random.default_rng(11)
    use.create(Transform((0.0, -0.5)), AABBCollider((30.0, 0.5), restitution=0.3))
    use.create(Transform((0.0, 3.0)), RigidBody(kind="kinematic", linear_velocity=(0.5, 0.0)), AABBCollider((2.0, 0.2)))
    alive = []
    for step in range(STEPS):
        if step % 3 == 0 and len(alive) < 40:
            collider = (SphereCollider, AABBCollider)[step % 2](rng.uniform(0.2, 0.5), restitution=rng.random())
            body = RigidBody(rng.uniform(0.5, 5.0), rng.normal(size=2) * 4, linear_damping=0.1 * (step % 2))
            extra = [Charge(rng.normal())] if step % 5 == 0 else []
            alive.append(use.create(Transform((rng.uniform(-4, 4), rng.uniform(1, 9))), body, collider, *extra))
        if step % 7 == 6:
            use.delete(alive.pop(int(rng.integers(len(alive)))), immediate=bool(step % 2))
        if step % 11 == 10:
            use.add(alive[0], Charge(1.0))
            use.add(alive[1], RigidBody(2.0, (0.0, 3.0)))
            use.remove(alive[2], RigidBody)
        if step % 11 == 0 and step:
            use.add(alive[2], RigidBody(1.0))
        use.step()
        yield


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


# -- processes -------------------------------------------------------------------------------------------------------

SCRIPT = """
import sys
sys.path.insert(0, sys.argv[1])
from test_determinism import Facade, mixed_scene, settled
world = settled()
for _ in mixed_scene(world, Facade(world)): pass
from carom.framework.compilation import log
print(world.state_hash(), len(log.compiled), log.loaded)
"""


def in_a_process(cache: Path, seed: str) -> tuple[str, int, int]:
    environment = {**os.environ, "CAROM_CACHE_DIR": str(cache), "PYTHONHASHSEED": seed, "CAROM_CHECK": "1"}
    command = [sys.executable, "-c", SCRIPT, str(Path(__file__).parent)]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    digest, compiled, loaded = result.stdout.split()
    return digest, int(compiled), int(loaded)


@pytest.mark.slow  # compiles everything
def test_other_processes_with_a_cold_and_a_warm_cache_get_the_same_bits(tmp_path):
    """And with checked indices (CAROM_CHECK=1), other than this process."""
    cold, warm = in_a_process(tmp_path, "1"), in_a_process(tmp_path, "2")
    assert cold[1] > 5
    assert warm[1] == 0  # every kernel came from the disk
    assert warm[2] >= cold[1]
    world = settled()
    for _ in mixed_scene(world, Facade(world)):
        pass
    assert cold[0] == warm[0] == world.state_hash()
