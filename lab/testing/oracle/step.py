"""The whole step in plain Python, for small scenes: an oracle that the compiled systems must agree with.

It is written from the description of the step, not from the kernels: one object per body, one per pair, no tables, no
compilation, every pair tested. It takes about a millisecond per body and step. The order of its stages is described in
docs/collisions.md::

    free flight -> pairs whose motions come near -> contacts at the end of flight -> resting prediction
    -> impacts in order of time -> contacts at rest, solved in substeps -> final contacts

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

from ....framework import Settings, World
from ...measure.body_shapes import Floats
from .bodies import Body, Pair, Touch, bodies_of, touch
from .impacts import Impact, Impacts
from .rest import ROUNDING, Kept, find_resting
from .solver import solve

INTEGRATORS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet")
CURVED = ("velocity_verlet", "flight")  # methods whose paths are parabolas under a force
NEIGHBOURS = 0.1  # of the smallest half extent: enlargement of the boxes around the motion
SAME_PLACE = 1e-9  # of the size: smaller gaps count as none


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
        self._by_entity = {body.entity: body for body in self.bodies}
        self._memory = _memory_of(world, set(self._by_entity))

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
                if sweeping or _motions_come_near(a, b):
                    movable = a.inverse_mass + b.inverse_mass > 0.0
                    pairs.append(Pair(a, b, pushes=movable and not (a.sensor or b.sensor)))
        return pairs

    def _predict_resting(self, travels: float, curved: bool) -> None:
        """The resting prediction: the last step's impulses act again, relaxed once, and never pull."""
        dt = self.settings.dt
        free = {body: body.velocity for body in self.bodies}
        pushes = []
        for (one, other), kept in self._memory.items():
            pair = Pair(self._by_entity[one], self._by_entity[other])
            _kick(pair, kept.total * kept.normal)
            pushes.append((pair, kept))
        for pair, kept in pushes:
            parting = float((pair.b.velocity - pair.a.velocity) @ kept.normal)
            if parting > 0.0:
                _kick(pair, -min(kept.total, parting * pair.mass) * kept.normal)
        for body in {body: None for pair, _ in pushes for body in pair.bodies if body.inverse_mass > 0.0}:
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
        self.doubts += [pair.key for pair in pairs if pair.doubtful]
        solved = solve(contacts, self._memory, self.settings, not self.impacts) if contacts else {}
        self.doubts += [contact.pair.key for contact in contacts if contact.doubtful]
        held = {body for body, moving in solved.items() if moving.held and body.inverse_mass > 0.0}
        for body in self.bodies:
            if body in held:
                body.position, body.velocity = body.start + solved[body].shift, solved[body].velocity
            elif body.resting_prediction is not None:
                if not body.stopped:
                    body.position = body.position - travels * self.settings.dt * body.resting_prediction
                body.velocity = body.velocity - body.resting_prediction
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


def _motions_come_near(a: Body, b: Body) -> bool:
    boxes = []
    for body in (a, b):
        ends = np.array([body.start, body.position]) + body.offset
        reach = body.half + NEIGHBOURS * body.half.min()
        boxes.append((ends.min(axis=0) - reach, ends.max(axis=0) + reach))
    (low_a, high_a), (low_b, high_b) = boxes
    return bool((low_a <= high_b).all() and (low_b <= high_a).all())


def _touch_now(pair: Pair) -> Touch:
    return touch(pair.a, pair.b, pair.between(pair.a.position, pair.b.position))


def _kick(pair: Pair, impulse: Floats) -> None:
    pair.a.velocity = pair.a.velocity - pair.a.inverse_mass * impulse
    pair.b.velocity = pair.b.velocity + pair.b.inverse_mass * impulse


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
        relative to the scene's scales: the step, the largest coordinate, speed and impulse of moving bodies
    """
    steps = world.step_count, oracle.step_count
    assert steps[0] == steps[1], f"the world is at step {steps[0]}, its oracle at {steps[1]}"
    at, dt = f"step {world.step_count}", oracle.settings.dt
    bodies = world.bodies
    moving = [body for body in oracle.bodies if body.kind != "static"]
    speed_scale = max([*(float(np.abs(b.velocity).max()) + b.gained for b in moving), 1e-300])
    place_scale = max([*(float(np.abs(b.position).max()) + b.size for b in moving), speed_scale * dt])
    heaviest = max([*(body.mass for body in moving if body.kind == "dynamic"), 1e-300])
    impulse_scale = max([*(c.normal_impulse for c in oracle.contacts.values()), heaviest * speed_scale])

    def check(what: str, name: str, got: object, expected: object, scale: float) -> None:
        off = float(np.abs(np.asarray(got) - np.asarray(expected)).max())
        assert off <= tolerance * scale, (
            f"{what}, {at}: {name} is {np.asarray(got).tolist()}, the oracle says {np.asarray(expected).tolist()}: "
            f"{off:.3g} apart, limit {tolerance * scale:.3g}"
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
        check(f"entity {body.entity}", "position", bodies.position[row], body.position, place_scale)
        check(f"entity {body.entity}", "linear_velocity", bodies.linear_velocity[row], body.velocity, speed_scale)
    now = world.contacts
    pairs = list(zip(now.entity_a.tolist(), now.entity_b.tolist(), strict=True))
    assert pairs == list(oracle.contacts), f"{at}: contacts are {pairs}, the oracle says {list(oracle.contacts)}"
    for row, (pair, contact) in enumerate(oracle.contacts.items()):
        what = f"contact of {pair[0]} and {pair[1]}"
        check(what, "depth", now.depth[row], contact.depth, place_scale)
        check(what, "normal", now.normal[row], contact.normal, 1.0)
        check(what, "normal_impulse", now.normal_impulse[row], contact.normal_impulse, impulse_scale)
