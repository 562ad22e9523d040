"""The oracle's last word of what cannot be moved: bodies that the solver has pushed into it or through it are put back,
and lose the speed that leads there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from carom.framework import Settings

from .bodies import FAST, Body, Pair, touch
from .sweeps import NEARLY, enters, last_leg

ALLOWED = 0.05  # of the size: deepest overlap, unless it was deeper before
ROUNDS = 4  # over what a body touches; the last one is for static bodies alone
KNOWN = 0.05  # of the size: so far around its path the neighbours of a body are known


def obey_statics(led: Iterable[Body], bodies: Sequence[Body], pairs: Sequence[Pair], settings: Settings) -> None:
    """Put these bodies out of what cannot be moved; bodies and pairs are in canonical order."""
    immovable = [body for body in bodies if body.inverse_mass == 0.0]
    for body in led:
        if body.stopped:
            continue
        near = [pair for pair in pairs if body in pair.bodies and pair.pushes and _fixed(pair, body) in immovable]
        moved_by = set()
        for turn in range(ROUNDS):
            moved = {p for p in near if _may_stop(p, body, turn) and _keep_out(p, body, settings)}
            moved_by |= moved
            if not moved:
                break
        if _is_astray(body, settings.dt):
            others = sorted(immovable, key=lambda other: (other.kind != "kinematic", other.entity))
            all_pairs = [_pair(body, other) for other in others if _meets(body, other)]
            for _ in range(ROUNDS):
                moved = {pair for pair in all_pairs if _keep_out(pair, body, settings)}
                if len(moved_by | moved) > 1 and settings.collision != "discrete":
                    for pair in near:
                        pair.doubtful = True  # the order, as it depends on where neighbours are known
                if not moved:
                    break


def _fixed(pair: Pair, body: Body) -> Body:
    return pair.b if pair.a is body else pair.a


def _may_stop(pair: Pair, body: Body, turn: int) -> bool:
    return turn < ROUNDS - 1 or _fixed(pair, body).kind == "static"


def _pair(one: Body, other: Body) -> Pair:
    a, b = sorted((one, other), key=lambda body: body.entity)
    return Pair(a, b, pushes=True)


def _meets(one: Body, other: Body) -> bool:
    return bool(one.layer & other.mask and other.layer & one.mask) and not (one.sensor or other.sensor)


def _is_astray(body: Body, dt: float) -> bool:
    """True if the body is not in the box around its path, somewhat enlarged."""
    ends, known = np.array([body.start, body.at(dt)]), KNOWN * body.size
    inside = (ends.min(axis=0) - known <= body.position) & (body.position <= ends.max(axis=0) + known)
    return not inside.all()


def _keep_out(pair: Pair, body: Body, settings: Settings) -> bool:
    """Put the body out of the pair's other one, where it is deeper than it may be; returns whether it was."""
    a, b, size = pair.a, pair.b, pair.size
    first, end = last_leg(pair), pair.between(pair.a.position, pair.b.position)
    travel = end - first
    way, before = float(np.linalg.norm(travel)), touch(a, b, first).depth
    if before < -way:
        return False
    seen = touch(a, b, end)
    depth, normal = seen.depth, seen.normal
    entry = enters(pair, first, travel, FAST * size, pair.slop(settings)) if way > FAST * size else None
    if entry is not None:
        normal = entry[1]
        depth = -entry[0] - float(travel @ normal)
    far = depth - max(before, ALLOWED * size)
    if abs(far) <= NEARLY * size:
        pair.doubtful = True
    if not far > 0.0:
        return False
    out = normal if body is b else -normal
    body.position = body.position + far * out
    closing = float((body.velocity - _fixed(pair, body).velocity) @ out)
    body.velocity = body.velocity - min(0.0, closing) * out
    return True
