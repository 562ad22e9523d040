"""Known answers of mechanics: rough impacts, a gyroscope, billiards, a leaning card, bars that whirl between walls."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carom import scenes
from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.scenes.impacts.billiards import RADIUS
from carom.scenes.turning import billiards_spin

MODES = ("discrete", "continuous", "event_driven")
G = 9.81


def empty(d=2, gravity=0.0, **settings):
    return World(Physics(d, gravity=(0, -gravity, 0)[:d]), Rotation(), settings=Settings(**settings))


def wall(world, place, half, **collider):
    return world.create_entity(Transform(place), RigidBody(kind="static"), BoxCollider(half, **collider))


def motion(world, entity):
    """(velocity, angular velocity)."""
    w = world.component_for_entity(entity, Spin).angular_velocity
    return np.array(world.component_for_entity(entity, RigidBody).linear_velocity), np.array(w)


# -- rough impacts --------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("d", "part"), [(2, 1 / 2), (3, 2 / 5)])
def test_a_rough_elastic_ball_leaves_without_slip_and_the_way_it_came_next_time(d, part, mode):
    """From (v, -u) with (v / (1 + k), u), k the part in I = k m r^2, and the spin that rolls; no slip is given back, as
    by a superball, which would leave with v (1 - k) / (1 + k). A second wall, above, changes nothing along itself."""
    r, v, u = 0.5, 1.0, 2.0
    with empty(d, collision=mode) as world:
        for y in (-1.0, 4.0):
            wall(world, (0, y, 0)[:d], (50, 1, 50)[:d], restitution=1.0, friction=100.0)
        shape = SphereCollider(r, restitution=1.0, friction=100.0)
        entity = world.create_entity(Transform((0, 1, 0)[:d]), RigidBody(1, (v, -u, 0)[:d]), Spin(), shape)
        found = []
        for _ in range(120):
            world.step()
            found.append(motion(world, entity))
    rolls = v / (1 + part)
    once = next(k for k, (velocity, _) in enumerate(found) if velocity[1] > 0)
    velocity, w = found[once]
    assert velocity[:2] == pytest.approx((rolls, u), rel=1e-12)
    assert (w if d == 2 else w[2]) == pytest.approx(-rolls / r, rel=1e-12)
    # At the upper wall the surface comes with twice the speed, and is stopped likewise.
    velocity, w = next(these for these in found[once:] if these[0][1] < 0)
    assert velocity[:2] == pytest.approx((rolls - 2 * rolls * part / (1 + part), -u), rel=1e-12)
    spin = -rolls / r + 2 * rolls / r / (1 + part)
    assert (w if d == 2 else w[2]) == pytest.approx(spin, rel=1e-12)


@pytest.mark.plain
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("e", [0.5, 1.0])
@pytest.mark.parametrize("mu", [0.0, 1e9])
def test_a_rough_rod_sticks_with_its_end_and_rebounds_by_stronges_law(mu, e, mode):
    """A friction without bound first stops the slip, by s / t; then the end sticks, while the speed along the normal
    grows by k = n - c^2 / t per impulse, and restitution gives e^2 of its work back: J = (1 + e) u' / k. n, t, c: what
    impulses along and across the normal do to the two speeds of the end. A smooth one has J = (1 + e) u / n alone."""
    half, angle, v = np.array((0.5, 0.05)), 0.5, np.array((1.0, -3.0))
    c, s = math.cos(angle), math.sin(angle)
    corners = np.array([(c * x - s * y, s * x + c * y) for x in (-half[0], half[0]) for y in (-half[1], half[1])])
    x, y = corners[np.argmin(corners[:, 1])]
    inertia = (half**2).sum() / 3
    n, t, both = 1 + x * x / inertia, 1 + y * y / inertia, -x * y / inertia
    with empty(collision=mode) as world:
        wall(world, (0, -1), (20, 1), restitution=e, friction=mu)
        shape = BoxCollider(half, restitution=e, friction=mu)
        entity = world.create_entity(Transform((0, -y + 0.02), angle), RigidBody(1.0, v), Spin(), shape)
        world.step()
        velocity, w = motion(world, entity)
    first, sticks = (-v[0] / t, both / t) if mu > 0.0 else (0.0, 0.0)
    along = -(1 + e) * (v[1] + both * first) / (n - both * sticks)
    across = first - sticks * along
    assert velocity == pytest.approx((v[0] + across, v[1] + along), rel=1e-6)
    assert w == pytest.approx((x * along - y * across) / inertia, rel=1e-6)


# -- a gyroscope ----------------------------------------------------------------------------------


def test_a_heavy_gyroscope_precesses_at_the_rate_of_its_weight_over_its_spin():
    """With a level axle, held at one end: M g l / (I w), exactly, if it starts with that. A step takes the torque as it
    stands at its start: of order 1."""
    across, along, spin, arm, weight, seconds = 0.02, 0.01, 60.0, 0.1, 5.0, 3.0
    rate, errors = arm * weight / (along * spin), []
    for dt in (1 / 120, 1 / 240, 1 / 480):
        with empty(3, dt=dt) as world:
            top = Spin((spin, rate, 0), (along, across, across))
            entity = world.create_entity(Transform((0, 0, 0)), RigidBody(), top)
            axle = np.array((1.0, 0.0, 0.0))
            assert len(world.bodies) == 1  # it is in the world
            for _ in range(round(seconds / dt)):
                world.component_for_entity(entity, Spin).apply_force((0, -weight, 0), at=arm * axle)
                world.component_for_entity(entity, RigidBody).apply_force((0, weight, 0))  # of what holds it
                world.step()
                w, x, y, z = world.component_for_entity(entity, Transform).rotation
                axle = np.array((1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)))
        errors.append(abs(math.atan2(-axle[2], axle[0]) - rate * seconds))
        assert abs(axle[1]) < 0.5 * dt
    assert errors[-1] < 1e-3 * rate * seconds
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(1.0, abs=0.2)


# -- billiards ------------------------------------------------------------------------------------


@pytest.mark.plain
@pytest.mark.parametrize("cut", [0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("english", [0.0, 3.0, -3.0])
def test_friction_throws_the_struck_ball_off_the_line_of_centres(cut, english):
    """By an angle of tangent min(mu, q / 7), q the slip over the approach; with English the cue ball spins upright, in
    speeds over radii. Smooth, elastic balls would leave along that line. Where slip ends, 1/7 of it goes to the struck
    ball: of two solid balls."""
    r, v, mu = 0.5, 4.0, 0.06
    with empty(3, collision="event_driven") as world:
        centre = 2 * r * np.array((math.cos(cut), 0, math.sin(cut)))  # of the struck ball when they meet at the origin
        entities = [
            world.create_entity(
                Transform(place), RigidBody(1.0, velocity), Spin((0, spin, 0)),
                SphereCollider(r, restitution=1.0, friction=mu),
            )
            for place, velocity, spin in (((-0.05, 0, 0), (v, 0, 0), english * v / r), (centre, (0, 0, 0), 0.0))
        ]  # fmt: skip
        for _ in range(3):
            world.step()
        (cue, w), (struck, u) = (motion(world, entity) for entity in entities)
    n, along = centre / (2 * r), np.array((-math.sin(cut), 0, math.cos(cut)))
    slip = -v * math.sin(cut) - english * v  # of the cue ball's surface, along
    thrown = math.copysign(min(mu * v * math.cos(cut), abs(slip) / 7), slip)
    assert struck == pytest.approx(v * math.cos(cut) * n + thrown * along, abs=1e-9)
    assert cue == pytest.approx(np.array((v, 0, 0)) - struck, abs=1e-9)
    assert w[1] - english * v / r == pytest.approx(u[1], abs=1e-9)  # both get the same twist


def test_follow_stop_and_draw_end_where_slip_and_rolling_lead():
    """After the impact a cue ball of spin w stands: it slips with mu g until it rolls with u = 2/7 r w, after u / mu g,
    and is u (T - u / (2 mu g)) on; the struck one gains 5/7 of the speed v in its frame, from above. To a step's way:
    contacts are told at steps."""
    speed, mu, seconds = billiards_spin.SPEED, billiards_spin.FRICTION, 1.0
    with scenes.get("billiards_spin").build() as world:
        entities = [entity for entity, _ in world.get_component(Spin)]
        for _ in range(round(seconds / world.settings.dt)):
            world.step()
        places = np.array([world.component_for_entity(entity, Transform).position[0] for entity in entities])
        step = speed * world.settings.dt
    after = seconds - billiards_spin.GAP / speed
    for k, spin in enumerate(billiards_spin.SPINS.values()):
        rolls, loss = -2 / 7 * spin * speed, 2 / 7 * speed
        expected = billiards_spin.GAP + rolls * (after - abs(rolls) / (2 * mu * G))
        assert places[2 * k] == pytest.approx(expected, abs=2 * step)
        expected = 2 * RADIUS + billiards_spin.GAP + 5 / 7 * speed * after + loss * loss / (2 * mu * G)
        assert places[2 * k + 1] == pytest.approx(expected, abs=2 * step)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("mu", [0.0, 0.06])
@pytest.mark.parametrize("spin", [(0, 0, -1), (0, 0, 1), (0, 1, 0)], ids=["follow", "draw", "throw"])
def test_a_rack_of_fifteen_keeps_momentum_and_angular_momentum(spin, mu, mode):
    """Balls that touch, and an elastic cue ball off the middle. Energy stays if they are smooth; else it only falls."""
    r, v = 0.5, 6.0
    rows = [(math.sqrt(3) * r * row, 0, (2 * k - row) * r) for row in range(5) for k in range(row + 1)]
    with empty(3, collision=mode, max_impacts_per_step=64) as world:
        for place in rows:
            shape = SphereCollider(r, restitution=1.0, friction=mu)
            world.create_entity(Transform(place), RigidBody(), Spin(), shape)
        shape = SphereCollider(r, restitution=1.0, friction=mu)
        body = RigidBody(1.0, (v, 0, 0))
        world.create_entity(Transform((-1.3, 0, 0.11)), body, Spin(np.multiply(spin, v / r)), shape)
        bodies = world.bodies

        def totals():
            x, u, w = bodies.position, bodies.linear_velocity, bodies.spin.angular_velocity
            inertia = 0.4 * r * r
            energy = 0.5 * (u**2).sum() + 0.5 * inertia * (w**2).sum()
            return energy, u.sum(0), (np.cross(x, u) + inertia * w).sum(0)

        first = last = totals()
        for _ in range(60):
            world.step()
            now = totals()
            assert now[0] <= last[0] * (1 + 1e-12)
            last = now
        assert world.stats().counters["impacts"] >= 15
        assert (np.linalg.norm(bodies.linear_velocity, axis=1) > 0.01).sum() > 10
    assert np.allclose(last[1], first[1], atol=1e-12 * v)
    assert np.allclose(last[2], first[2], atol=1e-11 * v)
    assert last[0] == pytest.approx(first[0], rel=1e-12) if mu == 0.0 else last[0] < 0.95 * first[0]


# -- a card, and what whirls ----------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("mu", [0.2, 0.4, 0.6])
def test_a_card_that_leans_on_a_wall_slides_where_friction_ends(mu, mode):
    """With the same friction at both ends, at tan a = (2 mu + q (1 + mu^2)) / (1 - mu^2) from the wall, q the thickness
    over the length: .99 of it stands within a mm for 3 s, with 16 substeps, and 1.04 falls."""
    half = np.array((0.01, 0.5))
    most = (2 * mu + half[0] / half[1] * (1 + mu * mu)) / (1 - mu * mu)
    for times in (0.99, 1.04):
        angle = math.atan(times * most)
        c, s = math.cos(angle), math.sin(angle)
        with empty(gravity=G, collision=mode, substeps=16, on_fault="ignore") as world:
            wall(world, (0, -1), (9, 1), friction=mu)
            wall(world, (-1, 0), (1, 9), friction=mu)
            place = np.array((half[0] * c + half[1] * s, half[1] * c + half[0] * s))
            entity = world.create_entity(Transform(place, angle), RigidBody(), Spin(), BoxCollider(half, friction=mu))
            for _ in range(180):
                world.step()
            way = np.abs(world.component_for_entity(entity, Transform).position - place).max()
        assert way < 1e-3 if times < 1 else way > 0.1


@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_thin_bar_that_whirls_between_walls_stays_between_them(e, mode):
    """40 of 2 m by 2 cm, each in a room of 3 m whose walls are 1 m thick, up to 500 rad/s and 30 m/s: no corner is ever
    out by 5 mm. Without restitution some have more impacts than a step takes, and sink in, but come out again."""
    random, half, room, n = np.random.default_rng(3), np.array((1.0, 0.01)), 1.5, 40
    with empty(collision=mode, max_impacts_per_step=64, on_fault="ignore") as world:
        centres = np.stack((10.0 * np.arange(n), np.zeros(n)), 1)
        for x, _ in centres:
            for way in (-1, 1):
                wall(world, (x + way * (room + 0.5), 0), (0.5, room + 1), restitution=e, friction=0.2)
                wall(world, (x, way * (room + 0.5)), (room + 1, 0.5), restitution=e, friction=0.2)
        entities = [
            world.create_entity(
                Transform(centre + random.uniform(-0.2, 0.2, 2), random.uniform(0, 3)),
                RigidBody(1.0, random.uniform(-30, 30, 2)), Spin(random.uniform(-500, 500)),
                BoxCollider(half, restitution=e, friction=0.2),
            )
            for centre in centres
        ]  # fmt: skip
        out = []
        for _ in range(60):
            world.step()
            for centre, entity in zip(centres, entities, strict=True):
                place = world.component_for_entity(entity, Transform)
                c, s = np.cos(place.rotation), np.sin(place.rotation)
                corners = half * ((-1, -1), (1, -1), (-1, 1), (1, 1)) @ ((c, s), (-s, c))
                out.append(np.abs(place.position - centre + corners).max() - room)
    assert max(out) < (0.25 if e == 0.0 else 0.005)
    assert max(out[-n:]) < 0.02


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("speed", [1.0, 9.0])
def test_a_smooth_crate_slides_over_the_seams_of_a_floor_without_turning(speed, mode):
    with empty(gravity=G, collision=mode) as world:
        for k in range(40):
            wall(world, (k, -0.5), (0.5, 0.5), friction=0.0)
        body, shape = RigidBody(1.0, (speed, 0)), BoxCollider((0.25, 0.25), friction=0.0)
        entity = world.create_entity(Transform((1, 0.25)), body, Spin(), shape)
        for _ in range(240):
            world.step()
            assert abs(motion(world, entity)[1]) < 1e-3
        assert motion(world, entity)[0] == pytest.approx((speed, 0), abs=1e-5)
