"""The cost of a pair function registered by a plugin, compared with the same maths of a built-in shape and by hand.

All are kernels that run the narrow phase on the same candidates:

- registered: the linked batches of the registered functions, with all their overhead: sorting by shape, argument order,
  the check of the result;
- built in: the same kernel in worlds of spheres at the same places, for scenes of one shape;
- by hand: a loop of its own that only knows radii, once with the same check of the result, once without.

Each state has new random positions, because repeating one state would train the branch predictor.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ....components import Collider, RigidBody, SphereCollider, Transform
from ....framework import Phase, Plugin, World, column
from ....framework.compilation import inlined, kernel
from ....framework.jit.records.record import Record, make_record
from ....framework.jit.records.record_type import record_at
from ....framework.jit.records.schema import Schema, floats
from ....framework.vectors import add, divided, length, scale, sub
from ....plugins import Physics
from ....systems.narrow_phase.stages import collect_contacts, evaluate_pairs, select_pairs
from ....systems.records import STATE
from ....systems.shapes.linking.batches import is_sound
from ...bench.report import digits, span
from ...bench.results import machine
from ...cli.usage_errors import Problem
from ...measure.timing import Spread, no_garbage_collection, now
from ...plain import Plain
from ...reporting.progress import NO_PROGRESS, Progress
from ...reporting.text_tables import TextTable

BODIES = 4000
STATES = 8
CALLS = 5  # consecutive calls of one kernel on one state; then the other kernel runs
DENSITY = {2: 0.4, 3: 0.1}  # bodies of radius 1 per unit of volume: about 4 candidates per body
TARGET = 1.1  # times the same maths built in

Timed = dict[str, tuple[Any, list[tuple[Any, ...]]]]  # by name: a kernel, and its arguments for each state

plugin = Plugin("bench pairs")


@plugin.shape(cost=1)
class DiscCollider(Collider):
    """A copy of the sphere collider, as a plugin author would write it."""

    reach: float = column(positive=True)

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

select, collect, linked_pairs = inlined(select_pairs), inlined(collect_contacts), inlined(evaluate_pairs)


@inlined
def linked(state, radii):
    """The batches of the registered pairs."""
    linked_pairs(state, 0.0)
    return state.unsound == 0


@inlined
def radii_of_one_shape(state, radii, a, b):
    """The radii of rows a and b in a world of discs."""
    return radii.first[a], radii.first[b]


@inlined
def radii_of_two_shapes(state, radii, a, b):
    """The radii of rows a and b among discs and spheres."""
    shape, first, second = state.bodies.shape, radii.first, radii.second
    return first[a] if shape[a] == 0 else second[a], first[b] if shape[b] == 0 else second[b]


@inlined
def anything_goes(hit, depth, normal, point):
    """In place of the check."""
    return True


RADII_OF = {"discs": radii_of_one_shape, "discs and spheres": radii_of_two_shapes}


@cache
def by_hand(scene: str, check: Callable[..., bool]) -> Callable[..., bool]:
    """The loop over the pairs of that scene, written by hand; returns whether all contacts pass the check."""
    radii_of = RADII_OF[scene]

    @inlined
    def loop(state, radii):
        pairs, position, offset = state.pairs, state.bodies.position, state.bodies.offset
        sound = True
        for c in range(pairs.count):
            a, b = pairs.a[c], pairs.b[c]
            one, two = radii_of(state, radii, a, b)
            centre = add(position[a], offset[a])
            hit, depth, normal, point = round_round(one, two, sub(add(position[b], offset[b]), centre))
            sound &= check(hit, depth, normal, point)
            pairs.hit[c], pairs.depth[c], pairs.normal[c], pairs.point[c] = hit, depth, normal, add(centre, point)
        return sound

    return loop


@cache
def narrow_kernel(evaluate: Callable[..., bool], dimensions: int) -> Callable[..., Any]:
    """The narrow phase with that loop over the pairs; the kernel returns how many touch or nearly do, a sum over these,
    and whether all contacts are sound."""
    state_at, radii_at = record_at(STATE, dimensions), record_at(RADII, dimensions)

    @kernel
    def find_contacts(address, radii, dt):
        state = state_at(address)
        select(state, dt)
        sound = evaluate(state, radii_at(radii))
        collect(state, dt)
        places = 0
        for k in range(state.pairs.found):
            places += state.pairs.hits[k]
        return state.pairs.found, places, sound

    return find_contacts


@dataclass
class PairCost(Plain):
    """One scene: nanoseconds per candidate of each kernel, and the registered pair's time over that of two others.

    built_in, to_built_in
        None for scenes of several shapes
    """

    scene: str
    dimensions: int
    candidates: int
    registered: Spread
    built_in: Spread | None
    by_hand: Spread
    unchecked: Spread
    to_built_in: Spread | None
    to_by_hand: Spread


@dataclass
class PairCosts(Plain):
    """All scenes."""

    machine: dict[str, str]
    repeats: int
    costs: list[PairCost]


def pair_costs(repeats: int = 15, progress: Progress = NO_PROGRESS, bodies: int = BODIES) -> PairCosts:
    """Time all kernels on every scene, in 2D and 3D."""
    progress.begin(len(RADII_OF) * 2 * (repeats + 1))
    costs = [_cost(scene, d, repeats, progress, bodies) for scene in RADII_OF for d in (2, 3)]
    return PairCosts(machine(), repeats, costs)


def _cost(scene: str, dimensions: int, repeats: int, progress: Progress, bodies: int) -> PairCost:
    progress.say(f"{scene}, {dimensions}D")
    with contextlib.ExitStack() as stack:

        def arguments(kinds: list[Any]) -> list[tuple[Any, ...]]:
            """Those of a kernel for each state, and the state and radii themselves, which must live."""
            calls = []
            for seed in range(STATES):
                world = stack.enter_context(contextlib.closing(_world(kinds, dimensions, seed, bodies)))
                state, radii = _prepared(world)
                kept.append((state, radii))
                calls.append((state.address, radii.address, world.settings.dt))
            return calls

        kept: list[tuple[Record, Record]] = []
        discs = DiscCollider.many(reach=1.0)
        spheres = SphereCollider.many(radius=1.0)
        own = arguments([discs] if scene == "discs" else [discs, spheres])
        candidates = sum(state.candidates.count for state, _ in kept)
        timed: Timed = {
            "registered": (narrow_kernel(linked, dimensions), own),
            "by_hand": (narrow_kernel(by_hand(scene, is_sound), dimensions), own),
            "unchecked": (narrow_kernel(by_hand(scene, anything_goes), dimensions), own),
        }
        if scene == "discs":
            timed["built_in"] = narrow_kernel(linked, dimensions), arguments([spheres])
        _same(timed)
        progress.advance(1)
        seconds: dict[str, list[float]] = {name: [] for name in timed}
        for repeat in range(repeats):
            for name, spent in _once(timed, repeat).items():
                seconds[name].append(spent / (CALLS * candidates) * 1e9)
            progress.advance(1)
    spreads = {name: Spread.of(values) for name, values in seconds.items()}
    ratios = {
        f"to_{name}": Spread.of([one / two for one, two in zip(seconds["registered"], seconds[name], strict=True)])
        for name in ("built_in", "by_hand") if name in seconds
    }  # fmt: skip
    without = {"built_in": None, "to_built_in": None}
    return PairCost(scene, dimensions, round(candidates / STATES), **{**without, **spreads, **ratios})


def _once(timed: Timed, repeat: int) -> dict[str, float]:
    """The seconds of each kernel on all states, taking turns."""
    total = dict.fromkeys(timed, 0.0)
    with no_garbage_collection():
        for turn in range(STATES):
            for name in _turned(list(timed), turn + repeat):
                find_contacts, calls = timed[name]
                started = now()
                for _ in range(CALLS):
                    find_contacts(*calls[turn])
                total[name] += now() - started
    return total


def _turned(names: list[str], turn: int) -> list[str]:
    """The same names in another order at each turn: each is first equally often."""
    start = turn // 2 % len(names)
    return (names[start:] + names[:start])[:: 1 if turn % 2 == 0 else -1]


def _world(kinds: list[Any], dimensions: int, seed: int, bodies: int) -> World:
    world = World(Physics(dimensions=dimensions), plugin)
    rng = np.random.default_rng((seed, dimensions))
    side = (bodies / DENSITY[dimensions]) ** (1 / dimensions)
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


def _same(timed: Timed) -> None:
    """Compile all kernels and check that they find the same contacts; Problem if not."""
    find_contacts, calls = timed["registered"]
    expected = [find_contacts(*arguments) for arguments in calls]
    for name, (other, its_calls) in timed.items():
        if [other(*arguments) for arguments in its_calls] != expected:
            raise Problem(f"{name}: other contacts than those of the registered pair")


def largest(result: PairCosts) -> float:
    """The largest of the ratios to the built-in shape."""
    return max((cost.to_built_in.median for cost in result.costs if cost.to_built_in), default=math.nan)


def table(result: PairCosts) -> TextTable:
    """The costs as a table."""
    cells = []
    for cost in result.costs:
        times = (cost.registered, cost.built_in, cost.by_hand, cost.unchecked)
        ratios = (cost.to_built_in, cost.to_by_hand)
        cells.append((
            cost.scene, f"{cost.dimensions}D", f"{cost.candidates:,}",
            *("-" if spread is None else digits(spread.median) for spread in times),
            *(shown for spread in ratios for shown in _ratio(spread)),
        ))  # fmt: skip
    title = f"narrow phase: ns per candidate, medians of {result.repeats}; largest ratio to the built-in shape "
    title += f"{largest(result):.2f}, target at most {TARGET:g}"
    headings = (
        "scene", "", "candidates", "registered", "built in", "by hand", "unchecked", "to built in", "from .. to",
        "to by hand", "from .. to",
    )  # fmt: skip
    return TextTable(title, headings, cells, words=2)


def _ratio(spread: Spread | None) -> tuple[str, str]:
    return ("-", "-") if spread is None else (f"{spread.median:.2f}", span(spread))
