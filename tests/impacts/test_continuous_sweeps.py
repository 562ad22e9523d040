"""No tunnelling: B13 at its edges, B15; bullets that meet, filters, disabled contacts; also single ccd bodies."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_modes import along, bullet, each_mode, each_sweep, mode_world, positions, strikes, velocities
from worlds import ball, both_dimensions, box, make_world, position, run, velocity

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Phase, System

DT = 1 / 60


@both_dimensions
@each_mode
@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_b15_a_thousand_passes(mode, d, radius):
    """Between walls 1 m apart at 1000 m/s: after 60 steps 1000 impacts, and the start position, to rounding. No cap is
    on elastic impacts of event-driven worlds."""
    world = mode_world(mode, d, max_impacts_per_step=1 if mode == "event_driven" else 100)
    for side in (-1, 1):
        box(world, side * (0.5 + radius + 0.5), half=along(d, 0.5, 5.0, 5.0), kind="static")
    mover = bullet(world, 0.0, 1000.0, radius=radius, restitution=1.0)
    hits = strikes(world, 60)
    np.testing.assert_allclose(hits.time, (np.arange(1000) + 0.5) / 1000, rtol=1e-12)
    assert (np.diff(hits.time) > 0).all()
    assert position(world, mover)[0] == pytest.approx(0.0, abs=1e-11)
    assert velocity(world, mover)[0] == 1000.0
    assert world.stats().counters["capped_impacts"] == 0


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize(
    ("mode", "e"), [("continuous", 1.0), *((mode, e) for mode in ("continuous", "event_driven") for e in (0.9, 1.5))]
)
def test_b15_beyond_the_cap(mode, e, d):
    """Sixteen passes per step and a cap of eight: reported, and the ball stays between the walls, at speed."""
    world = mode_world(mode, d, max_impacts_per_step=8)
    for side in (-1, 1):
        box(world, side * 1.1, half=along(d, 0.5, 5.0, 5.0), kind="static")
    mover = bullet(world, 0.0, 1000.0, radius=0.1, restitution=e)
    capped, speed = 0, 1000.0
    for _ in range(60 if e == 1 else 2):
        world.step()
        now = abs(velocity(world, mover)[0])
        assert abs(position(world, mover)[0]) <= 0.5 + 1e-9
        assert len(world.contacts.impacts) <= 8
        assert now == pytest.approx(speed * e ** len(world.contacts.impacts), rel=1e-12)
        capped, speed = capped + world.stats().counters["capped_impacts"], now
    assert capped > 0
    assert any("impacts beyond 8 of a body in one step" in fault for fault in world.faults)


def field(with_bullets):
    """A discrete world: slow balls and boxes that bounce about, thin plates, and two bullets at the plates."""
    world = make_world()
    rng = np.random.default_rng(3)
    slow = []
    for k in range(40):
        place = 1.1 * np.array([k % 8, k // 8]) + rng.uniform(-0.05, 0.05, 2)
        make, size = ((ball, "radius"), (box, "half"))[k % 2]
        slow.append(make(world, place, rng.normal(size=2) * 3, **{size: 0.3}, restitution=1.0))
    plates = [box(world, (100.0 + 5 * k, 50.0), half=(0.01, 1.0), mass=3.0) for k in range(3)]
    bullets = []
    if with_bullets:
        for y, fast in ((50.0, True), (50.5, False)):
            body = RigidBody(1.0, (1000.0, 0.0), ccd=fast)
            bullets.append(world.create_entity(Transform((90.0, y)), body, SphereCollider(0.05, restitution=1.0)))
    run(world, 20)
    return world, slow, plates, bullets


def test_one_bullet_in_a_discrete_world():
    """1 kg on 3 kg, e = 1: -500 and 500; without ccd it passes; slow bodies elsewhere keep their bits."""
    world, slow, plates, bullets = field(True)
    without, same, *_ = field(False)
    np.testing.assert_array_equal(positions(world, slow), positions(without, same))
    np.testing.assert_array_equal(velocities(world, slow), velocities(without, same))
    assert velocity(world, bullets[0])[0] == pytest.approx(-500.0, rel=1e-12)
    struck = 9.94 / 1000
    assert position(world, bullets[0])[0] == pytest.approx(99.94 - 500 * (20 * DT - struck), rel=1e-12)
    assert velocity(world, bullets[1])[0] == 1000.0
    assert velocity(world, plates[0])[0] > 0
    assert world.momentum()[0] == pytest.approx(without.momentum()[0] + 2000.0, rel=1e-12)


@pytest.mark.plain
@each_sweep
def test_a_bullet_and_its_partners_partners(mode):
    """A bullet hits a ball that had nothing near it, which then hits another one far away, all in one step."""
    world = mode_world(mode)
    chain = [bullet(world, -10.0, 6000.0, restitution=1.0)]
    chain += [bullet(world, 20.0 * k, 0.0, restitution=1.0) for k in range(4)]
    box(world, 80.0, half=(0.01, 5.0), kind="static")
    hits = strikes(world, 1)
    order = [(chain[k], chain[k + 1]) for k in range(4)]
    assert list(zip(hits.entity_a.tolist(), hits.entity_b.tolist(), strict=True))[:4] == order
    # 9.8 m, three times 19.8, 19.89 to the wall, and the rest of the 100 m of the step back.
    back = 100 - 9.8 - 3 * 19.8 - 19.89
    assert hits.time[4] == pytest.approx((100 - back) / 6000, rel=1e-12)
    assert position(world, chain[4])[0] == pytest.approx(79.89 - back, rel=1e-12)
    assert velocities(world, chain)[:, 0].tolist() == pytest.approx([0, 0, 0, 0, -6000], abs=1e-9)


@pytest.mark.slow
@each_sweep
def test_what_a_step_of_several_searches_has_found_is_told(mode):
    """A sensor crossed on the way back, a contact disabled, a wall struck: all before pairs are searched again. What is
    too slow to be swept still meets a wall where the step ends."""
    for seed in range(3):
        rng, world = np.random.default_rng(seed), mode_world(mode, max_impacts_per_step=1000)
        behind = box(world, (7.5, 20.0), half=(0.05, 5.0), kind="static", sensor=True)
        walls = [box(world, (9.0, y), half=(0.05, 5.0), kind="static") for y in (20.0, 40.0)]
        flyers = [bullet(world, (8.5, y), (6000.0, 0.0), restitution=1.0) for y in (20.0, 40.0)]
        box(world, (9.0, -30.0), kind="static")
        slow = ball(world, (6.0, -30.0), 2.2 / DT)
        for place in rng.uniform(-6, 6, (300, 2)):
            bullet(world, place, rng.normal(size=2) * 300, radius=0.02, restitution=1.0)

        class Disable(System):
            phase = Phase.NARROW

            def process(self, dt, off=walls[1]):
                contacts = self.world.contacts
                contacts.enabled[contacts.entity_a == off] = False

        world.add_system(Disable())
        world.step()
        assert world.stats().counters["rounds"] > 0
        begin = set(zip(world.contacts.begin.entity_a.tolist(), world.contacts.begin.entity_b.tolist(), strict=True))
        pairs = [(behind, flyers[0]), (walls[0], flyers[0]), (walls[1], flyers[1])]
        assert [pair in begin for pair in pairs] == [True, True, False]
        assert velocities(world, flyers)[:, 0].tolist() == [-6000.0, 6000.0]
        assert position(world, slow)[0] < 8.1
