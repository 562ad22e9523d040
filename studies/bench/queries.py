"""Queries over discs at rest: what is where. carom takes an array of them, pymunk one after the other."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from carom.framework import World
from carom.lab.measure.timing import timed
from carom.scenes import gas, player_query

from .engines import CAROM, PYMUNK, Carom, Pymunk
from .plain import Floats

ROUNDS = 5  # of 1,000 queries each, at different places, each after a step
HALF, REACH = 2.0, 2.0  # m: of a box, and of a disc
EDGE = 0.02  # m from the wall, where rays begin: the discs are farther away


def _rays(at: Floats, side: float) -> tuple[Floats, Floats]:
    """Rays from one side of the box to the other, from the height x to the height y of each place; both ends (m, 2),
    outside all discs."""
    starts, ends = np.full_like(at, EDGE), np.full_like(at, side - EDGE)
    starts[:, 1], ends[:, 1] = at.T
    return starts, ends


def _own_rays(world: World, at: Floats, side: float) -> float:
    starts, ends = _rays(at, side)
    return float(np.mean(world.ray_casts(starts, ends - starts, np.linalg.norm(ends - starts, axis=1)).fraction))


def _boxes(peer: Pymunk, at: Floats, side: float) -> float:
    query, box, every = peer.space.bb_query, peer.pymunk.BB, peer.pymunk.ShapeFilter()
    return sum([len(query(box(x - HALF, y - HALF, x + HALF, y + HALF), every)) for x, y in at.tolist()])


def _discs(peer: Pymunk, at: Floats, side: float) -> float:
    query, every = peer.space.point_query, peer.pymunk.ShapeFilter()
    return sum([len(query(place, REACH, every)) for place in map(tuple, at.tolist())])


def _nearest(peer: Pymunk, at: Floats, side: float) -> float:
    query, every = peer.space.point_query_nearest, peer.pymunk.ShapeFilter()
    hits = [query(place, REACH, every) for place in map(tuple, at.tolist())]
    return float(np.mean([math.inf if hit is None else hit.distance for hit in hits]))


def _peers_rays(peer: Pymunk, at: Floats, side: float) -> float:
    query, every = peer.space.segment_query_first, peer.pymunk.ShapeFilter()
    ways = np.concatenate(_rays(at, side), axis=1).tolist()
    hits = [query((a, b), (c, d), 0.0, every) for a, b, c, d in ways]
    return float(np.mean([1.0 if hit is None else hit.alpha for hit in hits]))


Ask = Callable[[Any, Floats, float], float]
# By name, carom's and pymunk's at places (m, 2) in a box of that side. Both give the same number, but pymunk's boxes
# find the boxes around discs.
QUERIES: dict[str, tuple[Ask, Ask]] = {
    "box 4 x 4": (lambda world, at, _: len(world.query_aabbs(at - HALF, at + HALF).entities), _boxes),
    "disc r = 2": (lambda world, at, _: len(world.query_spheres(at, REACH).entities), _discs),
    "nearest within 2": (
        lambda world, at, _: float(np.mean(world.query_nearests(at, max_distances=REACH).distance)), _nearest,
    ),
    "ray across": (_own_rays, _peers_rays),
}  # fmt: skip


def time_queries(world: World, n: int, repeat: int, peer: bool) -> Iterator[tuple[str, str, list[float], float]]:
    """Of each query and engine: both names, the seconds of 1,000 in each round, and what they find, the rounds' mean.

    Each round follows a step of both, as in a game: the time includes what carom builds for the first query after a
    step; pymunk has built its tree in the step. Box2D calls Python for each hit, so its queries are not timed.
    """
    engines: list[tuple[str, Any, Any]] = [(CAROM, Carom(world), world)]
    if peer:
        engines.append((PYMUNK, other := Pymunk(world), other))
    for query, works in QUERIES.items():
        seconds, answers = defaultdict(list), defaultdict(float)
        for number in range(ROUNDS + 1):  # the first round compiles and is not counted
            at = player_query.places(n, player_query.QUERIES, repeat * (ROUNDS + 1) + number)
            for _, engine, _ in engines:
                engine.step(1)
            for (name, _, subject), work in list(zip(engines, works, strict=False))[:: 1 if number % 2 else -1]:
                spent, _, answer = timed(partial(work, subject, at, gas.side(n, 2)))
                if number:
                    seconds[name].append(spent)
                    answers[name] += answer / ROUNDS
        yield from ((query, name, seconds[name], answers[name]) for name, *_ in engines)
