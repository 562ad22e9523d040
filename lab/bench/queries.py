"""Times of queries: carom answers 1,000 in one array call, pymunk answers them one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from ...framework import World
from ...scenes import gas, player_query
from ..measure.body_shapes import Floats
from ..measure.timing import no_garbage_collection, timed

ROUNDS = 5  # of 1,000 queries each, at different places; the engines alternate
BOX_SIDE, REACH = 4.0, 2.0  # m
EDGE = 0.02  # m from the wall: the discs at rest start farther away


@dataclass(frozen=True)
class Query:
    """One kind of query: ``own`` runs it on a World, ``peer`` on a PymunkSpace, at places (m, 2) in a box of that side.

    Both return one number over all results, which must agree between the engines; ``figure`` is its name.
    """

    COUNT: ClassVar[int] = player_query.QUERIES
    name: str
    figure: str
    own: Callable[[World, Floats, float], float]
    peer: Callable[[Any, Floats, float], float]


def _rays(places: Floats, side: float) -> tuple[Floats, Floats]:
    """Rays from one side of the box to the other at the heights of the places; both ends (m, 2), outside all discs."""
    ends = np.full((2, *places.shape), EDGE)
    ends[:, :, 1] = places.T
    ends[1, :, 0] = side - EDGE
    return ends[0], ends[1]


def _own_rays(world: World, places: Floats, side: float) -> float:
    starts, ends = _rays(places, side)
    ways = ends - starts
    return float(np.mean(world.ray_casts(starts, ways, np.linalg.norm(ways, axis=1)).fraction))


QUERIES = (
    Query(
        "box 4 x 4", "hits",
        lambda world, places, _: len(world.query_aabbs(places - BOX_SIDE / 2, places + BOX_SIDE / 2).entities),
        lambda space, places, _: space.boxes(places - BOX_SIDE / 2, places + BOX_SIDE / 2),
    ),
    Query(
        "disc r = 2", "hits",
        lambda world, places, _: len(world.query_spheres(places, REACH).entities),
        lambda space, places, _: space.spheres(places, REACH),
    ),
    Query(
        "nearest within 2", "mean distance",
        lambda world, places, _: float(np.mean(world.query_nearests(places, max_distances=REACH).distance)),
        lambda space, places, _: float(np.mean(space.nearest(places, REACH))),
    ),
    Query(
        "ray across", "share of the way", _own_rays,
        lambda space, places, side: float(np.mean(space.rays(*_rays(places, side)))),
    ),
)  # fmt: skip


def time_queries(
    world: World, engines: dict[str, Any], bodies: int, seed: int
) -> dict[str, dict[str, tuple[list[float], dict[str, float]]]]:
    """By query and engine: seconds per 1,000 in each round, and the figure of the results, a mean over the rounds.

    ``engines``: "carom" and pymunk spaces. Each round follows a step of all engines, as in a game, so the time includes
    what carom builds for the first query after a step; pymunk has built its tree in the step.
    """
    side = gas.side(bodies, 2)
    return {query.name: _time_query(query, world, engines, bodies, side, seed) for query in QUERIES}


def _time_query(
    query: Query, world: World, engines: dict[str, Any], bodies: int, side: float, seed: int
) -> dict[str, tuple[list[float], dict[str, float]]]:
    names = list(engines)
    seconds, figures = {name: [] for name in names}, dict.fromkeys(names, 0.0)
    for number in range(ROUNDS + 1):  # the first round compiles and is not counted
        places = player_query.places(bodies, Query.COUNT, seed * (ROUNDS + 1) + number)
        for engine in engines.values():
            engine.step(1)
        turn = number % len(names)
        for name in names[turn:] + names[:turn]:
            work = partial(query.own, world) if name == "carom" else partial(query.peer, engines[name])
            with no_garbage_collection():
                took, _, answer = timed(partial(work, places, side))
            if number:
                seconds[name].append(took)
                figures[name] += answer / ROUNDS
    return {name: (seconds[name], {query.figure: figures[name]}) for name in names}
