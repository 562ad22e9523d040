"""State of contacts at rest between steps: snapshots, errors, changed steps, other units."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_rest import SLOP, G, heights, overlaps, speed, tower
from worlds import MODES, ball, box, floor, make_world, run

from carom.components import AABBCollider, SphereCollider
from carom.framework import Phase, StepError, System

ROWS = 6


def heap():
    """Balls and boxes that have fallen onto each other, still moving."""
    world = make_world(gravity=G)
    floor(world, friction=0.4)
    box(world, (-2.0, 4.0), half=(0.5, 5.0), kind="static")
    box(world, (7.0, 4.0), half=(0.5, 5.0), kind="static")
    rng = np.random.default_rng(7)
    places = [(1.05 * (k % ROWS) - 0.8 + 0.1 * rng.uniform(), 0.6 + 1.1 * (k // ROWS)) for k in range(5 * ROWS)]
    for k, place in enumerate(places):
        (ball if k % 3 else box)(world, place, friction=0.4, restitution=0.3 * (k % 2))
    return world


class Fails(System):
    phase = Phase.END
    armed = False

    def process(self, dt):
        if self.armed:
            self.armed = False
            raise RuntimeError("on purpose")


def test_a_step_that_fails_leaves_no_trace_in_the_impulses():
    """An error after the response undoes the impulses too: the following steps have the bits of a world without it."""
    calm, hurt = heap(), heap()
    saboteur = Fails()
    hurt.add_system(saboteur)
    for step in range(120):
        if step in (40, 41, 90):
            saboteur.armed = True
            with pytest.raises(StepError, match="on purpose"):
                hurt.step()
        calm.step()
        hurt.step()
        assert calm.state_hash() == hurt.state_hash()


@pytest.mark.parametrize("change", [{"dt": 1 / 120}, {"dt": 1 / 30}, {"substeps": 8}, {"substeps": 2}])
def test_another_step_in_mid_run_makes_no_body_jump(change):
    """Stored impulses are rescaled: those of another step would make 0.03 m/s, the contacts' change of length 0.014."""
    world = make_world(gravity=G)
    floor(world)
    ids = tower(world, 5)
    run(world, 300)
    before = heights(world, ids)
    world.settings = world.settings.replace(**change)
    fastest = 0.0
    for _ in range(600):
        world.step()
        fastest = max(fastest, speed(world))
    assert fastest < 0.02
    assert overlaps(world, ids).max() < SLOP
    assert np.abs(heights(world, ids) - before).max() < 0.02


def test_a_slop_of_ones_own_reaches_the_contacts():
    """With 0.05 m contacts at rest begin farther apart: two boxes with a gap of 0.04 are a contact at once."""
    found = []
    for slop in (None, 0.05):
        world = make_world(slop=slop)
        box(world, (0, 0))
        box(world, (0, 1.04))
        world.step()
        found.append(world.stats().counters["resting_contacts"])
    assert found == [0, 1]


@pytest.mark.parametrize("mode", MODES)
def test_what_rests_first_in_an_elastic_world_is_held_in_that_step(mode):
    """Nothing is expected to rest there, so the stages of contacts at rest are linked by the first contact itself."""
    world = make_world(gravity=G, collision=mode)
    bodies = [floor(world, restitution=1.0), ball(world, (0.0, 2.0), restitution=1.0)]
    run(world, 5)
    bodies.append(ball(world, (5.0, 1.0), restitution=1.0))
    run(world, 1)
    assert not world.physics.state.rest_ready
    for entity, collider in zip(bodies, (AABBCollider, SphereCollider, SphereCollider), strict=True):
        world.component_for_entity(entity, collider).restitution = 0.0
    run(world, 200)
    assert abs(heights(world, bodies[1:]) - 0.5).max() < SLOP
    assert world.physics.state.rest_ready
