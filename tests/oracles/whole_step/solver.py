"""The oracle's solver of contacts at rest, which advances their bodies in substeps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carom.framework import Settings
from carom.lab.measure.body_shapes import Floats

from .bodies import Body, Pair
from .islands import agree, choose_rigid, islands_of
from .rest import OPPOSED, RATIO, ROUNDING, Kept, Moving, Resting
from .shocks import stop_shocks

SHOT = 4.0  # times the fastest closing speed: no light body between heavy ones leaves them faster
LOAD = 1e-6  # of the impulse that forces give in a substep: less is none
ALONG = 0.5  # of a firm contact's normal along the sum of the normals of its body
OPEN, NEVER = 1e-9, 1e6  # of the size: what is less open touches; and may close by so much
DEEP, PUSH, PUSH_LIMIT = 0.02, 0.2, 0.05  # of the size: overlap corrected in position, its fraction, limit per step


def solve(
    contacts: list[Resting], memory: dict[tuple[int, int], Kept], settings: Settings, plastic: bool
) -> dict[Body, Moving]:
    """Advance the bodies of ``contacts`` (in canonical order) from the start of the step; returns their motion.

    memory: the contacts of the previous step, by pair; plastic: the step had no bounce. Bodies that no contact has
    pushed are not ``held``.
    """
    dt, substeps = settings.dt, settings.substeps
    h = dt / substeps
    bodies = {body: Moving(body, dt, h) for contact in contacts for body in contact.pair.bodies}
    contacts = by_colour(contacts)
    any_unsettled = warm_start(contacts, bodies, memory)
    choose_firm(contacts, bodies, h)
    any_unsettled |= let_go(contacts, bodies)
    blocks = find_blocks(contacts)
    omega = 0.5 * math.pi / h  # a spring of a quarter of the substeps' rate, ten times overdamped
    damping = 20.0 + h * omega
    stiff = h * omega * damping
    soft = omega / damping, stiff / (1.0 + stiff), 1.0 / (1.0 + stiff)
    sweep = Sweep(contacts, blocks, bodies, h, soft)
    sweep.measure()
    if plastic:
        stop_shocks(contacts, bodies, dt)
    for substep in range(substeps):
        choose_rigid(contacts, bodies, h)
        for body in bodies.values():
            body.velocity = body.velocity + h * body.acceleration
        for contact in contacts:
            if contact.impulse > 0.0:
                sweep.push(contact, contact.tangent + contact.impulse * contact.normal)
        for turn in range(4 if any_unsettled and substep == 0 else 0):
            active = propagate(contacts, bodies)
            sweep.over([contact for contact in active if turn > 0 or not contact.waits], biased=False)
        sweep.all_over(biased=True)
        for contact in contacts:
            contact.pushed = contact.pushed or contact.impulse > 0.0
        for body in bodies.values():
            body.shift = body.shift + h * body.velocity
        sweep.measure()
        push_out(contacts, bodies, substeps)
        sweep.measure()
        if substep == substeps - 1:
            sweep.leave_open()
        if plastic:
            stop_shocks(contacts, bodies, dt)
        for _ in range(4 if substep == substeps - 1 else 2):
            sweep.all_over(biased=False)
        for contact in contacts:
            contact.total += contact.impulse
            contact.pushed = contact.pushed or contact.impulse > 0.0
    hold_light(contacts, bodies, dt)
    for contact in contacts:
        contact.pair.impulse += contact.total + contact.shock
        if contact.pushed:
            for body in contact.pair.bodies:
                bodies[body].held = True
    return bodies


def by_colour(contacts: Sequence[Resting]) -> list[Resting]:
    """Give each contact the first colour that its movable bodies have not used; return them sorted by colour."""
    used: dict[Body, set[int]] = {}
    coloured = []
    for contact in contacts:
        movable = [body for body in contact.pair.bodies if body.inverse_mass > 0.0]
        taken = set().union(*(used.setdefault(body, set()) for body in movable))
        colour = next(c for c in range(len(taken) + 1) if c not in taken)
        for body in movable:
            used[body].add(colour)
        coloured.append((colour, contact))
    return [contact for _, contact in sorted(coloured, key=lambda entry: entry[0])]


def warm_start(contacts: Sequence[Resting], bodies: dict[Body, Moving], memory: dict[tuple[int, int], Kept]) -> bool:
    """Start with the last step's impulses, unless the normal has turned by more than 60 degrees.

    Bodies of contacts that no longer exist are unsettled, because their other contacts push too much. Returns True if
    there are any.
    """
    pairs = {contact.pair.key: contact for contact in contacts}
    by_entity = {body.entity: moving for body, moving in bodies.items()}
    for key, kept in memory.items():
        contact = pairs.get(key)
        if contact is not None and float(kept.normal @ contact.normal) > 0.5:
            contact.impulse = kept.impulse
            contact.tangent = kept.tangent - contact.normal * float(kept.tangent @ contact.normal)
            continue
        for entity in key:
            if entity in by_entity:
                by_entity[entity].unsettled = True
    return any(moving.unsettled for moving in bodies.values())


def choose_firm(contacts: Sequence[Resting], bodies: dict[Body, Moving], h: float) -> None:
    """Contacts with what cannot be moved are firm if their body has rested until now, and nobody presses on it, but not
    those that push against the sum of such normals of their body."""
    shared: set[Body] = set()
    way: dict[Body, Floats] = {}
    for contact in contacts:
        movable = [body for body in contact.pair.bodies if body.inverse_mass > 0.0]
        if len(movable) == 1:
            way[movable[0]] = way.get(movable[0], 0.0) - outwards(contact, movable[0])
            continue
        forced = max((float(np.linalg.norm(bodies[body].acceleration)) for body in movable), default=0.0) * h
        if contact.gap < -OPEN * contact.pair.size or contact.impulse > LOAD * contact.pair.mass * forced:
            shared.update(movable)
    for contact in contacts:
        movable = [body for body in contact.pair.bodies if body.inverse_mass > 0.0]
        if len(movable) == 1 and movable[0].resting_prediction is not None and movable[0] not in shared:
            contact.firm = -float(way[movable[0]] @ outwards(contact, movable[0])) > ALONG
        if contact.firm and contact.apart:
            contact.gap = max(0.0, contact.gap)


def let_go(contacts: Sequence[Resting], bodies: dict[Body, Moving]) -> bool:
    """Firm contacts that are open where the step starts wait until the others of their body bear its load; those that
    open further have no impulse any more. Returns True if any wait."""
    for contact in contacts:
        contact.waits = contact.firm and contact.apart
        if contact.waits:
            a, b = (bodies[body] for body in contact.pair.bodies)
            a.unsettled = b.unsettled = True
            speed = float((b.velocity - a.velocity) @ contact.normal)
            rounding = ROUNDING * float(np.linalg.norm(a.velocity) + np.linalg.norm(b.velocity))
            contact.doubtful |= contact.impulse > 0.0 and 0.0 < abs(speed) <= rounding
            if speed > 0.0:
                contact.impulse, contact.tangent = 0.0, 0.0 * contact.tangent
    return any(contact.waits for contact in contacts)


def propagate(contacts: Sequence[Resting], bodies: dict[Body, Moving]) -> list[Resting]:
    """The contacts of unsettled bodies; the bodies on their other sides become unsettled for the next pass."""

    def releases(body: Body) -> bool:
        return bodies[body].unsettled and body.inverse_mass > 0.0

    active = [contact for contact in contacts if any(map(releases, contact.pair.bodies))]
    for contact in active:
        for body in contact.pair.bodies:
            bodies[body].unsettled = True
    return active


def push_out(contacts: Sequence[Resting], bodies: dict[Body, Moving], substeps: int) -> None:
    """Separate deeply overlapping bodies by a fraction of the overlap, without changing their velocities."""
    for contact in contacts:
        pair, n = contact.pair, contact.normal
        a, b = bodies[pair.a], bodies[pair.b]
        overlap = -contact.gap - float((b.shift - a.shift) @ n)
        if overlap > DEEP * pair.size and not contact.parting and not contact.rigid:
            push = min(PUSH * overlap, PUSH_LIMIT * pair.size) / substeps * pair.mass
            a.shift = a.shift - push * a.inverse_mass * n
            b.shift = b.shift + push * b.inverse_mass * n
            contact.pushed = True


def hold_light(contacts: Sequence[Resting], bodies: dict[Body, Moving], dt: float) -> None:
    """A light body that leaves its heaviest partner too fast gives it what it has too much; momentum stays."""
    partners: dict[Body, list[Body]] = {}
    for contact in contacts:
        light = _light_body(contact.pair)
        if light is not None:
            partners.setdefault(light, []).append(_other(light, contact.pair))
    for light, heavy in partners.items():
        fastest = 0.0
        for other in heavy:
            pull = bodies[light].acceleration - bodies[other].acceleration
            speed = float(np.linalg.norm(light.first_velocity - other.first_velocity))
            fastest = max(fastest, speed + dt * float(np.linalg.norm(pull)))
        partner = min(heavy, key=lambda body: body.inverse_mass)
        one, other = bodies[light], bodies[partner]
        away = one.velocity - other.velocity
        speed = float(np.linalg.norm(away))
        if speed > SHOT * fastest:
            impulse = away * (1.0 - SHOT * fastest / speed) / (one.inverse_mass + other.inverse_mass)
            one.velocity = one.velocity - one.inverse_mass * impulse
            other.velocity = other.velocity + other.inverse_mass * impulse


# -- passes -----------------------------------------------------------------------------------------


def find_blocks(contacts: Sequence[Resting]) -> list[tuple[Resting, Resting]]:
    """Pairs of contacts on opposite sides of a light body between two heavy ones."""
    blocks = []
    seen: dict[Body, list[Resting]] = {}
    for contact in contacts:
        light = _light_body(contact.pair)
        if light is None:
            continue
        others = seen.setdefault(light, [])
        for other in reversed(others):
            ends = [_other(light, c.pair) for c in (contact, other)]
            opposed = float(outwards(contact, light) @ outwards(other, light)) < OPPOSED
            movable = sum(body.inverse_mass for body in ends) > 0.0
            if opposed and movable and not other.in_block and not contact.in_block:
                contact.in_block = other.in_block = True
                blocks.append((other, contact))
        others.append(contact)
    return blocks


def _light_body(pair: Pair) -> Body | None:
    a, b = pair.bodies
    if a.inverse_mass > 0.0 and a.inverse_mass >= RATIO * b.inverse_mass:
        return a
    return b if b.inverse_mass >= RATIO * a.inverse_mass else None


def _other(body: Body, pair: Pair) -> Body:
    return pair.b if pair.a is body else pair.a


def outwards(contact: Resting, body: Body) -> Floats:
    """The contact's normal, pointing away from that body."""
    return contact.normal if contact.pair.a is body else -contact.normal


@dataclass(eq=False)
class Sweep:
    """Repeated passes over contacts. soft: rate of the bias, factors of the mass and of the impulse."""

    contacts: list[Resting]
    blocks: list[tuple[Resting, Resting]]
    bodies: dict[Body, Moving]
    h: float
    soft: tuple[float, float, float]

    def over(self, chosen: Sequence[Resting], biased: bool) -> None:
        """Solve the normal impulse of each chosen contact, then friction; ``biased``: overlap is corrected too."""
        for contact in chosen:
            if not contact.in_block:
                self._stop(contact, biased)
        for block in self.blocks:
            if block[0] in chosen or block[1] in chosen:
                self._solve_block(*block, biased)
        for contact in chosen:
            if contact.friction > 0.0:
                self._solve_friction(contact)

    def all_over(self, biased: bool) -> None:
        """One pass over the contacts, but islands with rigid ones are solved until they agree; in the pass that pushes
        first without the contacts that are far open, then all."""
        self.over([contact for contact in self.contacts if contact.island < 0], biased)
        islands = islands_of(self.contacts)
        for near in (DEEP, math.inf) if biased else (math.inf,):
            for island in islands:
                active = [c for c in island if (c.pushing if biased else c.opening) * self.h <= near * c.pair.size]
                partners = [c for block in self.blocks if set(block) & set(active) for c in block if c not in active]
                agree([*active, *partners], self.bodies, self.h, biased, self.soft[2] / self.soft[1])
                for contact in island:
                    if contact.friction > 0.0:
                        self._solve_friction(contact)

    def measure(self) -> None:
        """What each contact asks of the velocity along its normal, for the present displacements of the bodies."""
        for contact in self.contacts:
            a, b = (self.bodies[body] for body in contact.pair.bodies)
            size = contact.pair.size
            room = contact.gap + float((b.shift - a.shift) @ contact.normal)
            near = ROUNDING * size + self.h * (a.slack + b.slack)
            if not contact.rigid:  # else nothing changes suddenly there
                contact.doubtful |= min(abs(room), abs(room + DEEP * size)) <= near
            contact.opening = contact.pushing = max(0.0, room) / self.h  # it may close within the substep
            contact.soft = contact.deep = False
            if room <= 0.0 and not contact.parting:
                contact.deep = room < -DEEP * size
                if contact.rigid or not contact.deep:
                    contact.pushing = self.soft[0] * max(room, -DEEP * size)
                    contact.soft = not (contact.rigid or contact.firm)

    def leave_open(self) -> None:
        """Firm contacts that are open, of bodies that others hold, are left to the next step."""
        held = {body for c in self.contacts if c.impulse > 0.0 for body in c.pair.bodies if body.inverse_mass > 0.0}
        for contact in self.contacts:
            a, b = (self.bodies[body] for body in contact.pair.bodies)
            room = contact.gap + float((b.shift - a.shift) @ contact.normal)
            is_open = contact.impulse == 0.0 and room > OPEN * contact.pair.size
            if is_open and contact.firm and held.intersection(contact.pair.bodies):
                contact.opening = NEVER * contact.pair.size / self.h

    def push(self, contact: Resting, impulse: Floats) -> None:
        """Apply ``impulse`` to b and its opposite to a."""
        a, b = (self.bodies[body] for body in contact.pair.bodies)
        a.velocity = a.velocity - a.inverse_mass * impulse
        b.velocity = b.velocity + b.inverse_mass * impulse

    def _velocity(self, contact: Resting) -> Floats:
        a, b = (self.bodies[body] for body in contact.pair.bodies)
        return b.velocity - a.velocity

    def _wrong(self, contact: Resting, biased: bool) -> tuple[float, bool]:
        """The velocity error of the contact, and whether it is corrected softly."""
        speed = float(self._velocity(contact) @ contact.normal)
        return speed + (contact.pushing if biased else contact.opening), biased and contact.soft

    def _stop(self, contact: Resting, biased: bool) -> None:
        wrong, softly = self._wrong(contact, biased)
        wanted, old = contact.pair.mass * wrong, contact.impulse
        if softly:
            wanted = self.soft[1] * wanted + self.soft[2] * old
        contact.impulse = max(0.0, old - wanted)
        contact.doubtful |= old > 0.0 and abs(old - wanted) <= ROUNDING * old
        self.push(contact, (contact.impulse - old) * contact.normal)

    def _solve_friction(self, contact: Resting) -> None:
        """Friction: reduce the sliding velocity with at most mu times the normal impulse."""
        velocity, n = self._velocity(contact), contact.normal
        pull = contact.tangent - contact.pair.mass * (velocity - n * float(velocity @ n))
        strength, limit = float(np.linalg.norm(pull)), contact.friction * contact.impulse
        if strength > limit:
            pull = pull * (limit / strength)
        change, contact.tangent = pull - contact.tangent, pull
        self.push(contact, change)

    def _solve_block(self, one: Resting, two: Resting, biased: bool) -> None:
        """Solve both impulses together: each is at least 0, and 0 if its contact opens (linear complementarity)."""
        light = one.pair.a if one.pair.a in two.pair.bodies else one.pair.b
        wrong = np.array([self._wrong(contact, biased)[0] for contact in (one, two)])
        w = light.inverse_mass
        ends = [_other(light, c.pair).inverse_mass for c in (one, two)]
        cosine = float(outwards(one, light) @ outwards(two, light))
        old = np.array([one.impulse, two.impulse])
        # change of the two velocities per unit of the two impulses
        effect = np.array([[w + ends[0], cosine * w], [cosine * w, w + ends[1]]])
        change = np.linalg.solve(effect, -wrong)
        if (old + change < 0.0).any():
            change = self._release(effect, wrong, old, 1)
            if wrong[1] + float(effect[1] @ change) < 0.0:  # releasing the second contact makes it close
                change = self._release(effect, wrong, old, 0)
        for contact, impulse in zip((one, two), change, strict=True):
            contact.impulse += float(impulse)
            self.push(contact, float(impulse) * contact.normal)

    @staticmethod
    def _release(effect: Floats, wrong: Floats, old: Floats, gone: int) -> Floats:
        """Changes of the impulses if that of contact ``gone`` becomes 0 and the other contact holds alone."""
        held, change = 1 - gone, np.empty(2)
        change[gone] = -old[gone]
        change[held] = max(-old[held], -(wrong[held] + effect[held, gone] * change[gone]) / effect[held, held])
        return change
