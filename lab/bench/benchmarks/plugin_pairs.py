"""The cost of a pair function registered by a plugin, compared with the same maths written into the kernel by hand.

Both are kernels that run the narrow phase on the same candidates. One calls the linked batches of the registered
functions and includes all their overhead: sorting by shape, argument order, the check of the result. The other has a
loop of its own that only knows radii. Each state has new random positions, because repeating one state would train the
branch predictor.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import numpy as np

from ....components import Collider, RigidBody, SphereCollider, Transform
from ....framework import Phase, Plugin, World, column
from ....framework.compilation import inlined, kernel
from ....framework.jit.record import Record, make_record
from ....framework.jit.record_type import record_at, record_type
from ....framework.jit.schema import Schema, floats
from ....framework.vectors import add, divided, length, scale, sub
from ....plugins import Physics
from ....systems.narrow_phase.stages import collect_contacts, evaluate_pairs, select_pairs
from ....systems.records import STATE
from ...commands.usage_errors import Problem
from ...measure.timing import Spread, no_garbage_collection, now
from ...reporting.progress_bar import NO_PROGRESS, Progress
from ...reporting.text_tables import TextTable
from ..report import digits, span
from ..results import machine

BODIES = 4000
STATES = 8
CALLS = 5  # consecutive calls of one kernel on one state; then the other kernel runs
DENSITY = {2: 0.4, 3: 0.1}  # bodies of radius 1 per unit of volume: about 4 candidates per body
TARGET = 1.3

plugin = Plugin("bench pairs")


@plugin.shape(cost=1)
class DiscCollider(Collider):
    """A copy of the sphere collider, as a plugin author would write it."""

    reach = column(positive=True)

    @staticmethod
    def bounds(shape, dimensions):
        if dimensions == 2:
            return shape.reach, shape.reach
        return shape.reach, shape.reach, shape.reach


@plugin.kernel
def round_round(one, two, d):
    """Contact of two round shapes: centre distance against the sum of the radii."""
    distance = length(d)
    depth = one + two - distance
    normal = divided(d, distance) if distance > 0.0 else first_axis(d)
    return depth >= 0.0, depth, normal, scale(normal, one - 0.5 * depth)


@plugin.kernel
def first_axis(d):
    if len(d) == 2:
        return 1.0, 0.0
    return 1.0, 0.0, 0.0


@plugin.pair(DiscCollider, DiscCollider)
def disc_disc(a, b, d):
    return round_round(a.reach, b.reach, d)


@plugin.pair(DiscCollider, SphereCollider)
def disc_sphere(a, b, d):
    return round_round(a.reach, b.radius, d)


RADII = Schema("Radii", first=floats(), second=floats())  # of the first shape and of the second, by row

select, collect, registered_pairs = inlined(select_pairs), inlined(collect_contacts), inlined(evaluate_pairs)


@inlined
def registered(state, radii):
    """The batches of the registered pairs."""
    registered_pairs(state, 0.0)


@inlined
def one_shape_by_hand(state, radii):
    """The loop for a world of discs, by hand."""
    pairs, radius = state.pairs, radii.first
    for c in range(pairs.count):
        a, b = pairs.a[c], pairs.b[c]
        write_by_hand(state, c, radius[a], radius[b])


@inlined
def two_shapes_by_hand(state, radii):
    """The loop for discs and spheres, by hand."""
    pairs, shape, first, second = state.pairs, state.bodies.shape, radii.first, radii.second
    for c in range(pairs.count):
        a, b = pairs.a[c], pairs.b[c]
        write_by_hand(state, c, first[a] if shape[a] == 0 else second[a], first[b] if shape[b] == 0 else second[b])


@inlined
def write_by_hand(state, c, one, two):
    """Test pair c of two radii."""
    pairs, position, offset = state.pairs, state.bodies.position, state.bodies.offset
    a, b = pairs.a[c], pairs.b[c]
    centre = add(position[a], offset[a])
    hit, depth, normal, point = round_round(one, two, sub(add(position[b], offset[b]), centre))
    pairs.hit[c], pairs.depth[c], pairs.normal[c], pairs.point[c] = hit, depth, normal, add(centre, point)


BY_HAND = {"discs": one_shape_by_hand, "discs and spheres": two_shapes_by_hand}


@cache
def narrow_kernel(evaluate: Callable[..., None], dimensions: int) -> Callable[..., Any]:
    """The narrow phase with that loop over the pairs; the kernel returns how many touch or nearly do, and a sum over
    these."""
    state_at, radii_at = record_at(record_type(STATE, dimensions)), record_at(record_type(RADII, dimensions))

    @kernel
    def find_contacts(address, radii, dt):
        state = state_at(address)
        select(state, dt)
        evaluate(state, radii_at(radii))
        collect(state, dt)
        places = 0
        for k in range(state.pairs.found):
            places += state.pairs.hits[k]
        return state.pairs.found, places

    return find_contacts


@dataclass
class PairCost:
    """One scene: nanoseconds per candidate of both kernels, and the ratio of their times."""

    scene: str
    dimensions: int
    candidates: int
    registered: Spread
    by_hand: Spread
    ratio: Spread

    @classmethod
    def from_dict(cls, plain: dict[str, Any]) -> Self:
        """From the output of ``dataclasses.asdict``, also after JSON."""
        spreads = {name: Spread.from_dict(plain[name]) for name in ("registered", "by_hand", "ratio")}
        return cls(**{**plain, **spreads})


@dataclass
class PairCosts:
    """All scenes."""

    machine: dict[str, str]
    repeats: int
    costs: list[PairCost]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, plain: dict[str, Any]) -> Self:
        """The inverse of :meth:`as_dict`, also after JSON."""
        return cls(**{**plain, "costs": [PairCost.from_dict(cost) for cost in plain["costs"]]})


def pair_costs(repeats: int = 15, progress: Progress = NO_PROGRESS, bodies: int = BODIES) -> PairCosts:
    """Time both kernels on every scene, in 2D and 3D."""
    progress.begin(len(BY_HAND) * 2 * (repeats + 1))
    costs = [_cost(scene, d, repeats, progress, bodies) for scene in BY_HAND for d in (2, 3)]
    return PairCosts(machine(), repeats, costs)


def _cost(scene: str, dimensions: int, repeats: int, progress: Progress, bodies: int) -> PairCost:
    progress.say(f"{scene}, {dimensions}D")
    linked, by_hand = narrow_kernel(registered, dimensions), narrow_kernel(BY_HAND[scene], dimensions)
    with contextlib.ExitStack() as stack:
        states = []
        for seed in range(STATES):
            world = stack.enter_context(contextlib.closing(_world(scene, dimensions, seed, bodies)))
            states.append(_prepared(world))
        calls = [(state.address, radii.address, world.settings.dt) for state, radii in states]
        _same(linked, by_hand, calls)
        progress.advance(1)
        candidates = sum(state.candidates.count for state, _ in states)
        seconds: dict[Any, list[float]] = {linked: [], by_hand: []}
        for repeat in range(repeats):
            total = dict.fromkeys(seconds, 0.0)
            with no_garbage_collection():
                for turn, arguments in enumerate(calls):
                    order = list(seconds)[:: 1 if (turn + repeat) % 2 == 0 else -1]
                    for find_contacts in order:
                        started = now()
                        for _ in range(CALLS):
                            find_contacts(*arguments)
                        total[find_contacts] += now() - started
            for find_contacts, spent in total.items():
                seconds[find_contacts].append(spent / (CALLS * candidates) * 1e9)
            progress.advance(1)
    ratios = [one / two for one, two in zip(seconds[linked], seconds[by_hand], strict=True)]
    return PairCost(
        scene, dimensions, round(candidates / STATES), Spread.of(seconds[linked]), Spread.of(seconds[by_hand]),
        Spread.of(ratios),
    )  # fmt: skip


def _world(scene: str, dimensions: int, seed: int, bodies: int) -> World:
    world = World(Physics(dimensions=dimensions), plugin)
    rng = np.random.default_rng((seed, dimensions))
    side = (bodies / DENSITY[dimensions]) ** (1 / dimensions)
    kinds: list[Any] = [DiscCollider.many(reach=1.0)]
    if scene != "discs":
        kinds.append(SphereCollider.many(radius=1.0))
    for kind in kinds:
        count = bodies // len(kinds)
        places, speeds = rng.uniform(0, side, (count, dimensions)), rng.normal(0, 1, (count, dimensions))
        world.create_entities(count, Transform.many(places), RigidBody.many(linear_velocity=speeds), kind)
    return world


def _prepared(world: World) -> tuple[Record, Record]:
    """The world's state with its candidates in order, as within a step, and the radii of the bodies."""
    for phase in (Phase.INTEGRATION, Phase.BROAD, Phase.NARROW):
        world.run(phase)
    physics: Any = world.physics
    state, radii = physics.state, make_record(RADII, physics.dimensions)
    state.moved = True  # outside a step nothing moves: the search is smaller
    columns = [
        getattr(record, f"column_{shape.columns[0]}")
        for shape, record in zip(physics.scene.linked.shapes, physics.scene.parameters.world, strict=True)
    ]
    radii.first, radii.second = columns[0], columns[-1]
    return state, radii


def _same(registered: Any, by_hand: Any, calls: list[tuple[Any, ...]]) -> None:
    """Compile both kernels and check that they find the same contacts; Problem if not."""
    for arguments in calls:
        if registered(*arguments) != by_hand(*arguments):
            raise Problem("the pair written by hand finds other contacts than the registered one")


def largest(result: PairCosts) -> float:
    """The largest of the ratios."""
    return max((cost.ratio.median for cost in result.costs), default=math.nan)


def table(result: PairCosts) -> TextTable:
    """The costs as a table."""
    cells = [
        (cost.scene, f"{cost.dimensions}D", f"{cost.candidates:,}", digits(cost.registered.median),
         digits(cost.by_hand.median), f"{cost.ratio.median:.2f}", span(cost.ratio))
        for cost in result.costs
    ]  # fmt: skip
    middle = statistics.median(cost.ratio.median for cost in result.costs)
    title = f"narrow phase: ns per candidate, medians of {result.repeats}; ratio {middle:.2f}, the largest "
    title += f"{largest(result):.2f}, target at most {TARGET:g}"
    headings = ("scene", "", "candidates", "registered", "by hand", "ratio", "from .. to")
    return TextTable(title, headings, cells, words=2)
