"""The whole step in plain Python, for small scenes: an oracle that the compiled systems must agree with.

It is written from the description of the step, not from the kernels: one object per body, one per pair, no tables, no
compilation, every pair tested. It takes about a millisecond per body and step. The order of its stages is described in
docs/collisions.md::

    free flight -> pairs whose motions come near -> contacts at the end of flight -> resting prediction
    -> impacts in order of time -> contacts at rest, solved in substeps -> out of what cannot be moved -> final contacts

If bodies are swept along their paths (``Settings.collision``, ``RigidBody.ccd``), every pair is tested along its whole
path, and again after each impact of one of its bodies.

Supported: spheres and boxes in 2D and 3D, turned or with an offset, one collider per body; gravity, constant forces and
damping; explicit and semi-implicit Euler and velocity Verlet, and event-driven flight; restitution, friction,
kinematic bodies, sensors, layers.
Not supported: force systems, user systems, other shapes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from carom.framework import Settings, World
from carom.lab.measure.body_shapes import Floats

from .bodies import Body, Pair, Touch, bodies_of, motions_come_near, touch
from .impacts import Impact, Impacts
from .rest import RATIO, ROUNDING, Kept, find_resting
from .solver import solve
from .statics import obey_statics

INTEGRATORS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet")
CURVED = ("velocity_verlet", "flight")  # methods whose paths are parabolas under a force
SAME_PLACE = 1e-9  # of the size: smaller gaps count as none
PASSES = 8  # of relaxing what is remembered of light and heavy bodies, after the first over all
THROWN = 20.0  # times the change of speed by forces: what changes a velocity more, and more than a pair closes with


@dataclass(frozen=True)
class OracleContact:
    """A pair that touches at the end of the step or had an impulse in it; the normal points from a to b."""

    depth: float
    normal: Floats
    normal_impulse: float


class Oracle:
    """A copy of a small world between two steps; :meth:`step` advances it without any compiled code.

    world
        not changed; its present settings and gravity are used. ValueError for unsupported features
    """

    def __init__(self, world: World) -> None:
        self.settings: Settings = world.settings
        self._method = "flight" if self.settings.collision == "event_driven" else self.settings.integrator
        if self._method not in (*INTEGRATORS, "flight"):
            raise ValueError(f"the oracle knows {', '.join(INTEGRATORS)}, got {self.settings.integrator!r}")
        foreign = [system.name for system in world.systems if system.parts() is None]
        foreign += [system.name for system in world.force_systems]
        if foreign:
            raise ValueError(f"the oracle does not know what this world's systems do: {', '.join(foreign)}")
        self.gravity = np.array(world.gravity, float)
        self.bodies = bodies_of(world)
        self.step_count = world.step_count
        self.contacts: dict[tuple[int, int], OracleContact] = {}
        self.impacts: list[Impact] = []  # of the last step, in order; with pair, time, normal, impulse
        self.capped_impacts = 0  # of the last step
        self.doubts: list[tuple[int, int]] = []  # pairs decided by rounding in the last step
        # m/s of bodies, N s of contacts: by how much the last step may differ where the solver repeats its passes until
        # little changes
        self.slack: dict[Body, float] = {}
        self.impulse_slack: dict[tuple[int, int], float] = {}
        self._by_entity = {body.entity: body for body in self.bodies}
        self._memory = _memory_of(world, set(self._by_entity))

    def body(self, entity: int) -> Body:
        """KeyError for an entity that is not a body."""
        return self._by_entity[entity]

    def position(self, entity: int) -> Floats:
        """(d,) m; KeyError for an entity that is not a body."""
        return self._by_entity[entity].position

    def velocity(self, entity: int) -> Floats:
        """(d,) m/s; KeyError for an entity that is not a body."""
        return self._by_entity[entity].velocity

    def run(self, steps: int) -> None:
        """Take that many steps."""
        for _ in range(steps):
            self.step()

    def step(self) -> None:
        """Take one step of ``settings.dt``."""
        settings, dt = self.settings, self.settings.dt
        moving = [body for body in self.bodies if body.kind != "static"]
        sweeping = settings.collision != "discrete" or any(body.ccd for body in moving)
        curved = self._method in CURVED and self._something_acts()
        # displacement by a constant force, over dt dv
        travels = 0.5 if curved else 0.0 if self._method == "explicit_euler" else 1.0
        for body in self.bodies:
            body.begin()
            body.fly(dt, self.gravity, self._method, curved)
        pairs = self._pairs_that_may_meet(sweeping)
        for pair in pairs:
            pair.depth = _touch_now(pair).depth
            pair.near = pair.depth >= (-pair.margin(settings) if pair.pushes else 0.0)
        self._predict_resting(travels, curved)
        impacts = Impacts(pairs, settings, curved, sweeping)
        impacts.run()
        self.impacts, self.capped_impacts = impacts.done, impacts.capped
        self._hold_what_rests(pairs, travels)
        for pair in pairs:
            slack = dt * sum(self.slack.get(body, 0.0) for body in pair.bodies)
            if pair.impulse == 0.0 and abs(_touch_now(pair).depth) <= slack:
                self.doubts.append(pair.key)  # whether they touch in the end
        self.contacts = dict(sorted(_contacts(pairs).items()))
        self.step_count += 1

    def _something_acts(self) -> bool:
        freely = [body for body in self.bodies if body.kind == "dynamic"]
        return bool(self.gravity.any() or any(body.damping or body.constant_force.any() for body in freely))

    def _pairs_that_may_meet(self, sweeping: bool) -> list[Pair]:
        """Pairs whose layers meet, not both static; without sweeping, the boxes around their motions must overlap."""
        pairs = []
        for index, a in enumerate(self.bodies):
            for b in self.bodies[index + 1 :]:
                layers_meet = a.layer & b.mask and b.layer & a.mask
                if not layers_meet or a.kind == b.kind == "static":
                    continue
                near = motions_come_near(a, b)
                if sweeping or near:
                    pushes = a.inverse_mass + b.inverse_mass > 0.0 and not (a.sensor or b.sensor)
                    pairs.append(Pair(a, b, pushes, surely_near=near))
        return pairs

    def _predict_resting(self, travels: float, curved: bool) -> None:
        """The resting prediction: the last step's impulses act again. Where they push bodies apart they are relaxed,
        and never pull; those of shocks are left out."""
        dt = self.settings.dt
        free = {body: body.velocity for body in self.bodies}
        pushes = []
        for (one, other), kept in self._memory.items():
            push = _Push(Pair(self._by_entity[one], self._by_entity[other]), kept.normal)
            push.add(kept.total)
            pushes.append(push)
        for push in pushes:
            push.relax()
        for push in [push for push in pushes if push.is_uneven] * PASSES:
            push.relax()
        for _ in range(PASSES):
            thrown = [push for push in pushes if push.drop_shock(free)]
            if not thrown:
                break
        for body in {body: None for push in pushes for body in push.pair.bodies if body.inverse_mass > 0.0}:
            dv = body.resting_prediction = body.velocity - free[body]
            body.position = body.position + travels * dt * dv
            line, curve = body.path
            if curved:
                body.path = line, curve + travels / dt * dv
            else:
                body.path = line + travels * dv, curve

    def _hold_what_rests(self, pairs: Sequence[Pair], travels: float) -> None:
        """Solve the contacts at rest; pushed bodies follow the solver, the others keep their free flight."""
        contacts = find_resting(pairs, travels, self.settings)
        in_order = pairwise(self.impacts)
        self.doubts = [two.pair.key for one, two in in_order if two.time - one.time <= ROUNDING * two.time]
        solved = solve(contacts, self._memory, self.settings, not self.impacts) if contacts else {}
        self.doubts += [contact.pair.key for contact in contacts if contact.doubtful]
        for body, moving in solved.items():
            self.slack[body] = self.slack.get(body, 0.0) + moving.slack
        self.impulse_slack = {}
        for contact in contacts:
            speeds = sum(solved[body].slack for body in contact.pair.bodies)
            self.impulse_slack[contact.pair.key] = self.settings.substeps * (contact.slack + contact.pair.mass * speeds)
        held = [body for body, moving in solved.items() if moving.held and body.inverse_mass > 0.0]
        for body in self.bodies:
            if body in held:
                body.position, body.velocity = body.start + solved[body].shift, solved[body].velocity
            elif body.resting_prediction is not None:
                if not body.stopped:
                    body.position = body.position - travels * self.settings.dt * body.resting_prediction
                body.velocity = body.velocity - body.resting_prediction
        led = {body for body in self.bodies if body in held or body.resting_prediction is not None}
        obey_statics([body for body in self.bodies if body in led], self.bodies, pairs, self.settings)
        self.doubts += [pair.key for pair in pairs if pair.doubtful]
        self._memory = {
            contact.pair.key: Kept(contact.normal, contact.impulse, contact.tangent, contact.total)
            for contact in contacts
            if contact.total > 0.0
        }


def _memory_of(world: World, known: set[int]) -> dict[tuple[int, int], Kept]:
    """Warm start data of the world's contacts at rest, as impulses for the present step length."""
    physics: Any = world.physics
    memory = physics.state.warm_start
    now, dt = memory.now, world.settings.dt
    whole, part = dt / memory.step[now], dt / world.settings.substeps / memory.substep[now]
    kept = {}
    for k in range(memory.counts[now]):
        key = int(memory.entity_a[now, k]), int(memory.entity_b[now, k])
        normal, tangent = memory.normal[now, k].copy(), memory.tangent[now, k] * part
        kept[key] = Kept(normal, float(memory.impulse[now, k]) * part, tangent, float(memory.total[now, k]) * whole)
    return {key: value for key, value in kept.items() if known.issuperset(key)}


def _touch_now(pair: Pair) -> Touch:
    return touch(pair.a, pair.b, pair.between(pair.a.position, pair.b.position))


@dataclass(eq=False)
class _Push:
    """What acts again of a contact's impulse of the last step."""

    pair: Pair
    normal: Floats
    impulse: float = 0.0

    def add(self, impulse: float) -> None:
        a, b = self.pair.bodies
        self.impulse += impulse
        a.velocity = a.velocity - a.inverse_mass * impulse * self.normal
        b.velocity = b.velocity + b.inverse_mass * impulse * self.normal

    @property
    def is_uneven(self) -> bool:
        """Whether one can be moved at least ten times as easily as the other, which can be moved too."""
        heavy, light = sorted(body.inverse_mass for body in self.pair.bodies)
        return heavy > 0.0 and light >= RATIO * heavy

    def relax(self) -> None:
        """Take back what pushes the two apart."""
        parting = float((self.pair.b.velocity - self.pair.a.velocity) @ self.normal)
        self.add(-max(0.0, min(self.impulse, parting * self.pair.mass)))

    def drop_shock(self, free: dict[Body, Floats]) -> bool:
        """Take all back if a body's velocity changes by more than forces and the pair explain; whether it does."""
        movable = [body for body in self.pair.bodies if body.inverse_mass > 0.0]
        change = max(float(np.linalg.norm(body.velocity - free[body])) for body in movable)
        one, other = (free.get(body, body.velocity) for body in self.pair.bodies)
        closing = float(np.linalg.norm(other - one))
        is_shock = self.impulse > 0.0 and change > THROWN * self.pair.gained + closing
        if is_shock:
            self.add(-self.impulse)
        return is_shock


def _contacts(pairs: Sequence[Pair]) -> dict[tuple[int, int], OracleContact]:
    """Contacts at the end, pairs with impulse and crossings; solid pairs with a gap of rounding count as touching."""
    found = {}
    for pair in pairs:
        now, pushed = _touch_now(pair), pair.impulse > 0.0
        if pushed or pair.crossed or now.depth >= (-SAME_PLACE * pair.size if pair.pushes else 0.0):
            normal = pair.normal if pushed and pair.normal is not None else now.normal
            found[pair.key] = OracleContact(max(0.0, now.depth), normal, pair.impulse)
    return found


def assert_agrees(world: World, oracle: Oracle, tolerance: float = 1e-9) -> None:
    """The world and its oracle are in the same state, after the same impacts in the last step; AssertionError names the
    first difference.

    tolerance
        relative to the scene's scales: the step, the largest coordinate, speed and impulse of moving bodies; the
        oracle's ``slack`` is added to it
    """
    steps = world.step_count, oracle.step_count
    assert steps[0] == steps[1], f"the world is at step {steps[0]}, its oracle at {steps[1]}"
    at, dt = f"step {world.step_count}", oracle.settings.dt
    bodies = world.bodies
    assert sorted(bodies.entity.tolist()) == sorted(body.entity for body in oracle.bodies), (
        f"{at}: the world has other bodies than its oracle: take a new Oracle(world) when bodies come or go"
    )
    moving = [body for body in oracle.bodies if body.kind != "static"]
    speed_scale = max([*(float(np.abs(b.velocity).max()) + b.gained for b in moving), 1e-300])
    place_scale = max([*(float(np.abs(b.position).max()) + b.size for b in moving), speed_scale * dt])
    heaviest = max([*(body.mass for body in moving if body.kind == "dynamic"), 1e-300])
    impulse_scale = max([*(c.normal_impulse for c in oracle.contacts.values()), heaviest * speed_scale])

    def check(what: str, name: str, got: object, expected: object, scale: float, slack: float = 0.0) -> None:
        off, limit = float(np.abs(np.asarray(got) - np.asarray(expected)).max()), tolerance * scale + slack
        assert off <= limit, (
            f"{what}, {at}: {name} is {np.asarray(got).tolist()}, the oracle says {np.asarray(expected).tolist()}: "
            f"{off:.3g} apart, limit {limit:.3g}"
        )

    struck = world.contacts.impacts
    rows = [index for index, step in enumerate(struck.step.tolist()) if step == steps[0] - 1]
    pairs = [(int(struck.entity_a[row]), int(struck.entity_b[row])) for row in rows]
    expected = [impact.pair.key for impact in oracle.impacts]
    assert pairs == expected, f"{at}: impacts are {pairs}, the oracle says {expected}"
    for row, impact in zip(rows, oracle.impacts, strict=True):
        what = f"impact of {impact.pair.a.entity} and {impact.pair.b.entity}"
        check(what, "time_of_impact", struck.time_of_impact[row], impact.time, dt)
        check(what, "normal", struck.normal[row], impact.normal, 1.0)
        check(what, "normal_impulse", struck.normal_impulse[row], impact.impulse, impulse_scale)
    for body in moving:
        row = bodies.row_of(body.entity)
        what, slack = f"entity {body.entity}", oracle.slack.get(body, 0.0)
        check(what, "position", bodies.position[row], body.position, place_scale, slack * dt)
        check(what, "linear_velocity", bodies.linear_velocity[row], body.velocity, speed_scale, slack)
    now = world.contacts
    pairs = list(zip(now.entity_a.tolist(), now.entity_b.tolist(), strict=True))
    assert pairs == list(oracle.contacts), f"{at}: contacts are {pairs}, the oracle says {list(oracle.contacts)}"
    for row, (pair, contact) in enumerate(oracle.contacts.items()):
        what = f"contact of {pair[0]} and {pair[1]}"
        one, other = (oracle.body(entity) for entity in pair)
        slack = (oracle.slack.get(one, 0.0) + oracle.slack.get(other, 0.0)) * dt
        check(what, "depth", now.depth[row], contact.depth, place_scale, slack)
        check(what, "normal", now.normal[row], contact.normal, 1.0, 2.0 * slack / Pair(one, other).size)
        slack = oracle.impulse_slack.get(pair, 0.0)
        check(what, "normal_impulse", now.normal_impulse[row], contact.normal_impulse, impulse_scale, slack)
