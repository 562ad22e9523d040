"""The oracle's shocks: contacts that close fast, and those that they set in motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carom.lab.measure.body_shapes import Floats

from .bodies import Body
from .rest import ROUNDING, Moving, Resting

SHOCK = 0.01  # sizes per step
PASSES, FEWEST, WORK = 256, 16, 20_000  # passes at most; those that may be made after so many visits
SETTLED = 0.015  # of the speed of the shock that has reached a contact: smaller changes are not passed on


@dataclass(eq=False)
class _Blow:
    """What a contact has received in this shock."""

    impulse: float
    tangent: Floats


def stop_shocks(contacts: Sequence[Resting], bodies: dict[Body, Moving], dt: float) -> int:
    """Stop what closes fast: a contact is solved again as long as its bodies are changed by much. Contacts in their
    order. Returns how many were solved, each as often as it was."""
    asked, reach = _closing(contacts, bodies, dt)
    blows = {id(c): _Blow(0.0, np.zeros_like(c.normal)) for c in contacts}
    visits = 0
    for turn in range(PASSES):
        if not asked or (turn >= FEWEST and visits > WORK):
            break
        for contact in contacts:
            if id(contact) not in asked:
                continue
            asked.remove(id(contact))
            visits += 1
            change = _stop(contact, blows[id(contact)], bodies)
            movable = [body for body in contact.pair.bodies if body.inverse_mass > 0.0]
            speed = max(reach.get(body, 0.0) for body in movable)
            contact.doubtful |= abs(change - SETTLED * speed) <= ROUNDING * speed
            if change > SETTLED * speed:
                reach.update(dict.fromkeys(movable, speed))
                asked |= {id(c) for c in contacts if c is not contact and set(movable) & set(c.pair.bodies)}
    for contact in contacts:
        contact.shock += blows[id(contact)].impulse
        contact.pushed = contact.pushed or blows[id(contact)].impulse > 0.0
    return visits


def _closing(
    contacts: Sequence[Resting], bodies: dict[Body, Moving], dt: float
) -> tuple[set[int], dict[Body, float]]:
    """The contacts that close fast, and of their bodies that can be moved the largest such speed."""
    asked: set[int] = set()
    reach: dict[Body, float] = {}
    for contact in contacts:
        a, b = (bodies[body] for body in contact.pair.bodies)
        speed = float((a.velocity - b.velocity) @ contact.normal) - contact.opening
        least = SHOCK * contact.pair.size
        contact.doubtful |= abs(speed * dt - least) <= ROUNDING * contact.pair.size
        if speed * dt > least:
            asked.add(id(contact))
            for body in contact.pair.bodies:
                if body.inverse_mass > 0.0:
                    reach[body] = max(reach.get(body, 0.0), speed)
    return asked, reach


def _stop(contact: Resting, blow: _Blow, bodies: dict[Body, Moving]) -> float:
    """Stop the contact along its normal, and along its surface; returns the change of its speed."""
    pair, n = contact.pair, contact.normal
    a, b = (bodies[body] for body in pair.bodies)

    def push(impulse: Floats) -> None:
        a.velocity = a.velocity - a.inverse_mass * impulse
        b.velocity = b.velocity + b.inverse_mass * impulse

    old = blow.impulse
    wanted = pair.mass * (float((b.velocity - a.velocity) @ n) + contact.opening)
    blow.impulse = max(0.0, old - wanted)
    contact.doubtful |= old > 0.0 and abs(old - wanted) <= ROUNDING * old
    push((blow.impulse - old) * n)
    if contact.friction > 0.0:
        velocity = b.velocity - a.velocity
        pull = blow.tangent - pair.mass * (velocity - n * float(velocity @ n))
        strength, limit = float(np.linalg.norm(pull)), contact.friction * blow.impulse
        if strength > limit:
            pull = pull * (limit / strength)
        change, blow.tangent = pull - blow.tangent, pull
        push(change)
    return abs(blow.impulse - old) / pair.mass
