"""suggest_dt and step_limits: known limits of stability, and of speed against thin things; the world is left alone."""

from __future__ import annotations

import itertools
import json
import math

import numpy as np
import pytest
from helpers_motion import METHODS, Oscillator, SpringAndDrag, all_methods, oscillators, record
from oracles import integrators_naive as naive
from worlds import ball, box, floor, make_world, run

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, NoPhysicsError, Plugin, Settings, StepError, System, World
from carom.lab.stability import growth, growth_of_system, stability_limits
from carom.lab.suggest import SAFETY, step_limits, suggest_dt
from carom.plugins import Physics
from carom.plugins.half_space import HalfSpaceCollider
from carom.plugins.half_space import plugin as half_space
from carom.plugins.springs import Springs
from carom.systems import Integrator
from carom.systems.integrators import STANDARD_INTEGRATORS

# B6: undamped, drag alone (dt = limit / c), then damping ratios 0.05, 0.5 and 1; as (stiffness, drag) at omega = 1
COLUMNS = [(1.0, 0.0), (0.0, 1.0), (1.0, 0.1), (1.0, 1.0), (1.0, 2.0)]
TABLE = {
    "explicit_euler": (0, 2, 0.1, 1.0, 2.0),
    "semi_implicit_euler": (2, 2, 1.902, 1.236, 0.828),
    "velocity_verlet": (2, 2, 1.91, 2.0, 1.0),
    "rk4": (2 * math.sqrt(2), 2.7853, 2.91, 2.62, 2.7853),
}
DIGITS = 3e-3  # of the table
NOISE = 1e-6  # relative, of frequencies that finite differences give


# -- the published table -------------------------------------------------------------------------


@pytest.mark.parametrize("method", TABLE)
@pytest.mark.parametrize("column", range(5))
def test_the_limit_is_that_of_the_table(method, column):
    """B6, for w = 40 /s: at most the limit is suggested and at least half of it; 0 where no step is stable."""
    (stiffness, drag), limit, w = COLUMNS[column], TABLE[method][column], 40.0
    world = oscillators(method, 1 / 60, stiffness * w * w, drag * w, mass=1.0, v0=1.0)
    found = step_limits(world)
    assert found.stability * w == pytest.approx(limit, abs=DIGITS)
    assert 0.5 * limit <= found.suggested * w <= limit
    assert suggest_dt(world) == found.suggested == SAFETY * found.stability
    assert found.oscillation is not None
    assert found.oscillation.frequency == pytest.approx(w * math.sqrt(stiffness), rel=NOISE)
    assert found.oscillation.drag == pytest.approx(w * drag, rel=NOISE)


@all_methods
def test_limits_are_those_of_the_textbooks_step(method):
    """For damping ratios between those of the table, and Yoshida's method, which it has not."""
    drags = (0.0, 0.02, 0.3, 0.7, 1.5, 3.0, 10.0)
    limits = stability_limits(STANDARD_INTEGRATORS[method](), np.ones(len(drags)), drags)
    for drag, limit in zip(drags, limits, strict=True):
        expected = naive.stability_limit(method, 1.0, drag)
        assert limit == pytest.approx(expected if expected > 1e-5 else 0.0, rel=1e-6, abs=1e-9)


def test_a_limit_beyond_which_a_longer_step_is_stable_again():
    """Yoshida's method takes one Verlet step, not three, from linear_damping * dt = 5 on: the first limit counts."""
    limit = stability_limits(STANDARD_INTEGRATORS["yoshida4"](), 3.158, 0.0261, 4.444)[0]
    assert 0.4 < limit < 5 / 4.444 * (1 + 1e-9)


def halves(method, share):
    """Per column of the table: the largest size of the state in the first and the second half of a run of 4,000 steps,
    each oscillator at that share of its own limit."""
    limits = [step_limits(oscillators(method, 1 / 60, *column, v0=1.0)).stability for column in COLUMNS]
    rows = [(k * (share * h) ** 2, c * share * h) for (k, c), h in zip(COLUMNS, limits, strict=True) if h > 0]
    stiffness, drag = np.array(rows).T
    world = oscillators(method, 1.0, stiffness, drag, x0=np.where(stiffness > 0, 1.0, 0.0), v0=1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        _, velocities = record(world, 4000)
    sizes = np.nan_to_num(np.abs(velocities[:, :, 0]), nan=np.inf)
    return sizes[:2000].max(axis=0), sizes[2000:].max(axis=0)


@pytest.mark.slow
@all_methods
def test_runs_stay_bounded_below_the_limit_and_grow_above(method):
    """B6, the runs themselves: 0.999 and 1.01 of the limit that is found."""
    early, late = halves(method, 0.999)
    assert (late <= early * (1 + 1e-9)).all()
    early, late = halves(method, 1.01)
    assert ((late > 1.05 * early) | np.isinf(late)).all()


def test_explicit_euler_has_no_step_for_a_spring_without_damping():
    world = oscillators("explicit_euler", 1 / 60, [1.0, 4.0])
    limits = step_limits(world)
    assert suggest_dt(world) == 0.0
    assert "explicit_euler makes that grow at any step" in str(limits)
    assert "No step is stable: choose another integrator" in str(limits)


def test_event_driven_worlds_have_the_limits_of_their_flight():
    """Second order, like velocity Verlet, whatever the integrator: 2 and 1.91 (B6)."""
    for (stiffness, drag), limit in zip(COLUMNS, TABLE["velocity_verlet"], strict=True):
        found = step_limits(oscillators("explicit_euler", 1 / 60, stiffness, drag, collision="event_driven"))
        assert found.stability == pytest.approx(limit, abs=DIGITS)
        assert found.integrator == "flight"


# -- which oscillation it is ---------------------------------------------------------------------


def test_the_stiffest_body_counts():
    """w = sqrt(k / m): the lightest of four on equal springs is named."""
    world = oscillators("velocity_verlet", 1 / 60, 100.0, mass=[5.0, 1.0, 0.01, 2.0])
    limits = step_limits(world)
    assert limits.stability == pytest.approx(2 / math.sqrt(100 / 0.01), rel=NOISE)
    assert limits.oscillation.entity == world.bodies.entity[2]


def chain(n, stiffness=50.0, mass=2.0, damping=0.0, dimensions=2, **settings):
    """n bodies between two walls, joined by springs: w_max = 2 sqrt(k / m) sin(n pi / (2 (n + 1)))."""
    springs = Springs()
    world = World(Physics(dimensions=dimensions), springs, settings=Settings(**settings))
    ends = [
        world.create_entity(
            Transform((float(k), *(0.0,) * (dimensions - 1))),
            RigidBody(mass, kind="dynamic" if 0 < k <= n else "static"),
        )
        for k in range(n + 2)
    ]
    for a, b in itertools.pairwise(ends):
        springs.connect(a, b, stiffness=stiffness, damping=damping)
    return world, 2 * math.sqrt(stiffness / mass) * math.sin(n * math.pi / (2 * (n + 1)))


@pytest.mark.parametrize(("n", "dimensions"), [(1, 2), (2, 2), (7, 3), (60, 2)])
def test_chains_of_springs(n, dimensions):
    """All modes are found: the limit is that of the highest to rounding of the differences."""
    world, highest = chain(n, dimensions=dimensions)
    limits = step_limits(world)
    assert limits.oscillation.frequency == pytest.approx(highest, rel=NOISE)
    assert limits.stability == pytest.approx(2 / highest, rel=NOISE)


@pytest.mark.parametrize("n", [200, 1200])
def test_long_chains(n):
    """Only the extreme modes are sought: within a thousandth, and never stiffer than the stiffest."""
    world, highest = chain(n)
    limits = step_limits(world)
    assert 2 / highest * (1 - NOISE) <= limits.stability <= 2 / highest * 1.001
    assert suggest_dt(world) < 2 / highest


def test_a_spring_between_two_bodies():
    """k (1/m + 1/m'), and the damper between them alike: semi-implicit Euler's w h + c h / w <= 2 for small c."""
    springs = Springs()
    world = World(Physics(), springs)
    a, b = (world.create_entity(Transform((x, 0)), RigidBody(m)) for x, m in ((0, 0.5), (1, 8.0)))
    springs.connect(a, b, stiffness=300.0, damping=4.0)
    rate = 1 / 0.5 + 1 / 8.0
    limits = step_limits(world)
    expected = naive.stability_limit("semi_implicit_euler", 300 * rate, 4 * rate)
    assert limits.stability == pytest.approx(expected, rel=1e-5)
    assert limits.oscillation.entity == a


class Matrices(ForceSystem):
    """F = -K x - C v along the first axis, of bodies of one kilogram."""

    def __init__(self, stiffness, drag):
        self.stiffness, self.drag = np.array(stiffness, float), np.array(drag, float)

    def add_forces(self, bodies, time):
        bodies.force[:, 0] -= self.stiffness @ bodies.position[:, 0] + self.drag @ bodies.linear_velocity[:, 0]


def coupled(stiffness, drag, dt=1 / 60, **settings):
    world = make_world(dt=dt, **settings)
    for k in range(len(stiffness)):
        world.create_entity(Transform((1.0 + k, 0)), RigidBody(1.0, (1.0, 0)))
    world.add_system(Matrices(stiffness, drag))
    return world


@pytest.mark.parametrize("method", METHODS[1:4])
def test_bodies_whose_springs_and_drag_do_not_share_their_modes(method):
    """A spring between two bodies of which one alone is braked: the run stays bounded just below the limit."""
    stiffness, drag = [[50, -50], [-50, 50]], [[12, 0], [0, 0]]
    limit = step_limits(coupled(stiffness, drag, integrator=method)).stability
    for share, stable in ((0.99, True), (1.02, False)):
        world = coupled(stiffness, drag, share * limit, integrator=method)
        _, velocities = record(world, 4000)
        sizes = np.abs(velocities).max(axis=(1, 2))
        assert (sizes[2000:].max() <= sizes[:2000].max()) is np.bool_(stable)


@all_methods
@pytest.mark.parametrize("seed", range(4))
def test_coupled_bodies_against_the_matrix_of_the_whole_step(method, seed):
    """Random springs, dampers and linear damping of two to four bodies: the first step at which an eigenvalue leaves
    the unit circle, looked for in steps of 1 %."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 5))
    springs, dampers = (random.normal(size=(n, n)) * s for s in (10.0, 2.0))
    stiffness, drag, damping = springs @ springs.T, dampers @ dampers.T, random.uniform(0, 5, n) * (seed % 2)
    world = coupled(stiffness, drag, integrator=method)
    world.bodies.linear_damping[:] = damping
    limit = step_limits(world).stability
    h, integrator = 1e-3, STANDARD_INTEGRATORS[method]()
    while growth_of_system(integrator, stiffness, drag, damping, h) <= 1 + 1e-9:
        h *= 1.01
    assert 0.7 * h <= limit <= 1.01 * h


def test_free_motion_of_what_hangs_together_has_no_limit():
    """Two bodies with a damped spring between them: their centre flies freely, which explicit Euler does well."""
    springs = Springs()
    world = World(Physics(), springs, settings=Settings(integrator="explicit_euler"))
    a, b = (world.create_entity(Transform((x, 0)), RigidBody()) for x in (0, 1))
    springs.connect(a, b, stiffness=2.0, damping=0.5)
    assert suggest_dt(world) == pytest.approx(SAFETY * 1.0 / 4.0, rel=1e-5)  # c / k, both doubled


@pytest.mark.parametrize(("method", "limit"), [("explicit_euler", 0.0), ("semi_implicit_euler", 0.0), ("rk4", 8**0.5)])
def test_forces_that_turn_the_velocity(method, limit):
    """A magnetic field, 5 rad/s: eigenvalues on the imaginary axis."""

    class Field(ForceSystem):
        def add_forces(self, bodies, time):
            v = bodies.linear_velocity
            bodies.force[:] += 5.0 * np.column_stack((-v[:, 1], v[:, 0]))

    world = make_world(integrator=method)
    world.create_entity(Transform((1, 0)), RigidBody(linear_velocity=(1, 0)))
    world.add_system(Field())
    assert step_limits(world).stability == pytest.approx(limit / 5, rel=1e-6)


def test_linear_damping_alone_has_no_limit():
    """It is an integrating factor; beside a spring it gives explicit Euler the limit c / k (derived: det = 1)."""

    def limit(damping, stiffness, method):
        world = make_world(integrator=method)
        world.create_entity(Transform((1, 0)), RigidBody(linear_damping=damping), Oscillator(stiffness))
        world.add_system(SpringAndDrag())
        return step_limits(world).stability

    for method in METHODS:
        assert limit(1e6, 0.0, method) == math.inf
    assert limit(3.0, 100.0, "explicit_euler") == pytest.approx(3.0 / 100.0, rel=1e-6)
    assert limit(3.0, 100.0, "semi_implicit_euler") >= 2 / 10 * (1 - NOISE)


def test_a_rope_at_its_full_length_counts_as_taut():
    springs = Springs()
    world = World(Physics(), springs)
    a, b = world.create_entity(Transform((0, 0)), RigidBody()), world.create_entity(Transform((1, 0)), RigidBody(1.0))
    springs.connect(a, b, stiffness=800.0, only_pulls=True)
    assert step_limits(world).stability == pytest.approx(2 / 40, rel=1e-4)


def test_what_grows_by_itself_limits_no_step():
    """A body on top of a hill: no step could prevent it."""
    world = oscillators("velocity_verlet", 1 / 60, [-4.0, 1.0])
    assert step_limits(world).stability == pytest.approx(2.0, rel=NOISE)
    assert suggest_dt(oscillators("velocity_verlet", 1 / 60, -4.0)) == math.inf


def test_an_integrator_of_a_plugin():
    """Midpoint (B6): 0, 2, 0.80, 2.0, 2.0."""
    plugin = Plugin("midpoint")

    @plugin.integrator("midpoint")
    class Midpoint(Integrator):
        order, evaluations = 2, 2

        def advance(self, motion, dt):
            v0 = motion.velocity.copy()
            motion.position += dt / 2 * v0
            motion.velocity += dt / 2 * motion.inverse_mass[:, None] * motion.force
            middle = motion.velocity.copy()
            motion.evaluate(dt / 2)
            motion.position[:] = motion.start_position + dt * middle
            motion.velocity[:] = v0 + dt * motion.inverse_mass[:, None] * motion.force

    found = []
    for stiffness, drag in COLUMNS:
        world = World(Physics(), plugin, settings=Settings(integrator="midpoint"))
        world.create_entity(Transform((1, 0)), RigidBody(), Oscillator(stiffness, drag))
        world.add_system(SpringAndDrag())
        found.append(step_limits(world).stability)
        world.close()
    np.testing.assert_allclose(found, (0, 2, 0.80, 2.0, 2.0), atol=1e-2)
    assert found[0] == 0.0


def test_far_from_the_origin():
    """A spring to a place 10,000 km away from the origin, of 2 rad/s."""

    class Pull(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force -= 4.0 * (bodies.position - (1e7, -3e6))

    world = make_world()
    for x in (0, 1, 2):
        world.create_entity(Transform((1e7 + x, -3e6)), RigidBody())
    world.add_system(Pull())
    assert step_limits(world).stability == pytest.approx(1.0, rel=1e-4)


# -- nothing, and nonsense -----------------------------------------------------------------------


def test_worlds_in_which_nothing_limits():
    empty, still, falling = make_world(), make_world(gravity=10), make_world(gravity=10)
    floor(still)
    box(still, (0, 3), kind="kinematic")
    falling.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(5, 5)))
    for world in (empty, still, falling):
        assert suggest_dt(world) == math.inf
        assert step_limits(world).oscillation is None
    nobody = make_world()
    nobody.add_system(SpringAndDrag())
    assert suggest_dt(nobody) == math.inf
    assert "Nothing limits the step" in str(step_limits(nobody))
    plain = step_limits(empty).as_dict()
    assert json.loads(json.dumps(plain, allow_nan=False))["suggested"] is None


def test_forces_that_are_not_finite_are_named():
    class Hole(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force -= bodies.position / (bodies.position**2).sum(axis=1)[:, None] ** 1.5

    world = make_world()
    entity = ball(world, (0, 0))
    world.add_system(Hole())
    with np.errstate(all="ignore"), pytest.raises(ValueError, match=f"entity {entity}: the forces on it are"):
        suggest_dt(world)
    assert (world.bodies.position == 0).all()
    with pytest.raises(NoPhysicsError):
        suggest_dt(World())


def test_an_error_in_a_force_system_leaves_the_world_as_it_was():
    class Fails(ForceSystem):
        calls = 0

        def add_forces(self, bodies, time):
            self.calls += 1
            if self.calls > 3:
                raise RuntimeError("out of fuel")

    world = make_world()
    ball(world, (1, 2), (3, 4))
    world.add_system(Fails())
    before = world.state_hash()
    with pytest.raises(RuntimeError, match="out of fuel"):
        suggest_dt(world)
    assert world.state_hash() == before


def test_not_inside_a_step():
    class Asks(System):
        def process(self, dt):
            suggest_dt(self.world)

    world = oscillators("rk4", 1 / 60, 1.0)
    world.add_system(Asks())
    with pytest.raises(StepError, match="between steps only"):
        world.step()


# -- the world is left alone ---------------------------------------------------------------------


@pytest.mark.parametrize("collision", ["discrete", "continuous", "event_driven"])
def test_asking_changes_no_bit_of_what_follows(collision):
    """Bouncing and resting bodies on springs, asked before every step, beside their like that is never asked."""
    hashes = []
    for asked in (False, True):
        springs = Springs()
        world = World(Physics(gravity=(0, -10)), springs, settings=Settings(collision=collision))
        floor(world)
        bodies = [ball(world, (1.2 * k, 1.0 + k % 3), (k - 2.0, 0), restitution=0.2 * k) for k in range(6)]
        for a, b in itertools.pairwise(bodies):
            springs.connect(a, b, stiffness=40.0, damping=0.3)
        world.component_for_entity(bodies[0], RigidBody).apply_force((3.0, 1.0))
        found = []
        for _ in range(20):
            if asked:
                before = world.state_hash(), world.stats().counters, list(world.faults), world.time
                suggest_dt(world)
                assert before == (world.state_hash(), world.stats().counters, world.faults, world.time)
            world.step()
            found.append(world.state_hash())
        hashes.append(found)
        world.close()
    assert hashes[0] == hashes[1]


# -- speed against thin things -------------------------------------------------------------------


def shot(collision="discrete", speed=30.0, thickness=0.1, radius=0.25, **body):
    world = make_world(collision=collision)
    world.create_entity(Transform((0, 0)), AABBCollider((thickness / 2, 5.0)))
    world.create_entity(
        Transform((-3.0, 0)), RigidBody(linear_velocity=(speed, 0), **body), SphereCollider(radius, restitution=1.0)
    )
    return world


def test_a_ball_and_a_wall():
    """v dt <= w + 2 r."""
    limits = step_limits(shot())
    assert limits.tunnelling == pytest.approx(0.6 / 30)
    assert limits.suggested == pytest.approx(SAFETY * 0.6 / 30)
    assert limits.stability == math.inf
    assert "overlap on a way of 0.6 m" in str(limits)
    assert (limits.passage.entity, limits.passage.other) == (2, 1)
    assert step_limits(shot(ccd=True)).passage is None
    for collision in ("continuous", "event_driven"):
        assert step_limits(shot(collision)).passage is None


def test_the_shorter_of_both_limits_counts():
    world = shot()
    world.component_for_entity(2, RigidBody)
    world.add_component(2, Oscillator(1e6))
    world.add_system(SpringAndDrag())
    assert suggest_dt(world) == pytest.approx(SAFETY * 2e-3, rel=NOISE)


def test_what_does_not_meet_does_not_count():
    """Sensors, other layers, kinematic bodies against walls, half-spaces without an end."""
    world = World(Physics(), half_space)
    world.create_entity(Transform((0, 0)), AABBCollider((0.01, 5.0), sensor=True))
    world.create_entity(Transform((1, 0)), AABBCollider((0.01, 5.0), layer=4))
    world.create_entity(Transform((2, 0)), AABBCollider((0.02, 5.0)))
    world.create_entity(Transform((0, -9)), HalfSpaceCollider((0.0, 1.0)))
    world.create_entity(
        Transform((-3, 0)), RigidBody(linear_velocity=(50, 0), kind="kinematic"), SphereCollider(0.1, mask=1)
    )
    assert step_limits(world).passage is None  # nothing dynamic
    world.create_entity(Transform((-9, 0)), RigidBody(linear_velocity=(0, 10)), SphereCollider(0.3, mask=1))
    limits = step_limits(world)
    assert limits.tunnelling == pytest.approx(min(0.64 / 10, 0.8 / 60))


@pytest.mark.parametrize("seed", range(6))
def test_the_first_passage_against_all_pairs(seed):
    """Random sizes, speeds, layers and kinds: the shortest (size + size') / (speed + speed') of all pairs that meet."""
    random = np.random.default_rng(seed)
    world = make_world()
    bodies = []
    for k in range(40):
        kind = ("dynamic", "kinematic", "static")[random.integers(3)]
        velocity = np.zeros(2) if kind == "static" else random.normal(size=2) * 10 ** random.uniform(-1, 2)
        size, layer, mask = 10 ** random.uniform(-2, 1), 2 ** random.integers(3), random.integers(1, 8)
        world.create_entity(
            Transform((9.0 * k, 0)), RigidBody(linear_velocity=velocity, kind=kind),
            SphereCollider(size / 2, layer=int(layer), mask=int(mask)),
        )  # fmt: skip
        bodies.append((kind, float(np.linalg.norm(velocity)), size, layer, mask))
    expected = min(
        (a[2] + b[2]) / (a[1] + b[1])
        for a, b in itertools.combinations(bodies, 2)
        if "dynamic" in (a[0], b[0]) and a[3] & b[4] and b[3] & a[4] and a[1] + b[1] > 0
    )
    assert step_limits(world).tunnelling == pytest.approx(expected, rel=1e-12)


def test_scenes_of_the_library():
    """Each has an answer, none is changed by the question."""
    for name in ("stack", "billiards", "gas2d", "jump", "conveyor", "cradle"):
        with scenes.get(name).build() as world:
            run(world, 3)
            before = world.state_hash()
            assert suggest_dt(world) > 0
            assert world.state_hash() == before
        world.close()


def test_growth_of_one_step_is_known():
    """Explicit Euler 1 + z^2 squared away; Runge-Kutta 4: |lambda|^2 = 1 - z^6/72 + z^8/576 (B2)."""
    z = np.array([0.1, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(growth(STANDARD_INTEGRATORS["explicit_euler"](), z * z), np.sqrt(1 + z * z), rtol=1e-14)
    expected = np.sqrt(1 - z**6 / 72 + z**8 / 576)
    np.testing.assert_allclose(growth(STANDARD_INTEGRATORS["rk4"](), z * z), expected, rtol=1e-13)
