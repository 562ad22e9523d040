"""The cost of a pair function registered by a plugin, compared with the same maths written into the kernel by hand.

Both are narrow phase kernels on the same candidates. One is generated from the registered functions and includes all
their overhead: shape dispatch, argument order, the check of the result. The other calls a function that only knows
radii. Each state has new random positions, because repeating one state would train the branch predictor.
"""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
import math
import statistics
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ....components import Collider, RigidBody, SphereCollider, Transform
from ....framework import Phase, Plugin, World, column
from ....framework.compilation import inlined
from ....framework.vectors import divided, length, scale
from ....plugins import Physics
from ....systems.narrow_phase.system import make_narrow_kernel
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


@inlined
def one_shape_by_hand(shape_a, a, shape_b, b, d, shapes, like):
    """The narrow phase function for a world of discs, by hand."""
    return round_round(shapes[0][0][a], shapes[0][0][b], d)


@inlined
def two_shapes_by_hand(shape_a, a, shape_b, b, d, shapes, like):
    """The narrow phase function for discs and spheres, by hand."""
    one = shapes[0][0][a] if shape_a == 0 else shapes[1][0][a]
    two = shapes[0][0][b] if shape_b == 0 else shapes[1][0][b]
    return round_round(one, two, d)


BY_HAND = {"discs": one_shape_by_hand, "discs and spheres": two_shapes_by_hand}


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
    by_hand = make_narrow_kernel(BY_HAND[scene])
    with contextlib.ExitStack() as stack:
        calls = []
        for seed in range(STATES):
            world = stack.enter_context(contextlib.closing(_world(scene, dimensions, seed, bodies)))
            calls.append(_recorded(world))
        registered = calls[0][0]
        _same(registered, by_hand, [arguments for _, arguments in calls])
        progress.advance(1)
        candidates = sum(len(arguments[0]) for _, arguments in calls)
        seconds: dict[Any, list[float]] = {registered: [], by_hand: []}
        for repeat in range(repeats):
            total = dict.fromkeys(seconds, 0.0)
            with no_garbage_collection():
                for turn, (_, arguments) in enumerate(calls):
                    order = list(seconds)[:: 1 if (turn + repeat) % 2 == 0 else -1]
                    for kernel in order:
                        started = now()
                        for _ in range(CALLS):
                            kernel(*arguments)
                        total[kernel] += now() - started
            for kernel, spent in total.items():
                seconds[kernel].append(spent / (CALLS * candidates) * 1e9)
            progress.advance(1)
    ratios = [one / two for one, two in zip(seconds[registered], seconds[by_hand], strict=True)]
    return PairCost(
        scene, dimensions, round(candidates / STATES), Spread.of(seconds[registered]), Spread.of(seconds[by_hand]),
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


def _recorded(world: World) -> tuple[Any, tuple[Any, ...]]:
    """The kernel that the world's narrow phase calls for its candidates, and its arguments."""
    state: Any = world.physics
    world.run(Phase.INTEGRATION)
    world.run(Phase.BROAD)
    kernel, calls = state.kernels.find_contacts, []

    def record(*arguments: Any) -> Any:
        calls.append(arguments)
        return kernel(*arguments)

    state.kernels.find_contacts = record
    try:
        world.run(Phase.NARROW)
    finally:
        state.kernels.find_contacts = kernel
    (arguments,) = calls
    names = list(inspect.signature(getattr(kernel, "py_func", kernel)).parameters)
    arguments = list(arguments)
    arguments[names.index("dt")] = world.settings.dt  # outside a step nothing moves: the search is smaller
    return kernel, tuple(arguments)


def _same(registered: Any, by_hand: Any, states: list[tuple[Any, ...]]) -> None:
    """Compile both kernels and check that they find the same contacts; Problem if not."""
    for arguments in states:
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
