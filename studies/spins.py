"""What bodies that turn cost: times as long as the same scene without it, per body and step."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.lab.measure.timing import Spread
from carom.lab.reporting.text import TextTable, compact, span
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin

from .ladder import Rung, axis, drifting
from .runner import Axis, Result, Sample

BODIES, FEW = 3000, 300
HEIGHT = 10  # of a stack


def _flying(n: int, *components: Any, dimensions: int = 2) -> World:
    half = (0.4, 0.3, 0.2)[:dimensions]
    shape = BoxCollider.many(half_extents=half)
    return drifting(
        n, shape, *components, dimensions=dimensions, rotation=0.3 * (dimensions == 2), plugins=(Rotation(),)
    )


def _spins(dimensions: int = 2) -> Any:
    return Spin.many(1.0 if dimensions == 2 else (1.0, 0.5, 0.2))


def _balls(n: int, *components: Any, plugins: tuple[Any, ...] = (Rotation(),)) -> World:
    return drifting(n, SphereCollider.many(radius=0.5), *components, plugins=plugins)


def _stacks(n: int, shape: Any, *components: Any, dimensions: int = 2, one_more: bool = False) -> World:
    """Boxes that stand on each other, ten high. one_more: and a ball that turns, far away."""
    world = World(Physics(dimensions, gravity=(0.0, -9.81, 0.0)[:dimensions]), Rotation())
    column, height = np.divmod(np.arange(n), HEIGHT)
    side = math.ceil(math.sqrt(n / HEIGHT)) if dimensions == 3 else n
    places = np.stack((1.5 * (column % side), height + 0.5, 1.5 * (column // side)), axis=1)[:, :dimensions]
    world.create_entities(n, Transform.many(places), RigidBody.many(), shape, *components)
    floor = AABBCollider((2.0 * n, 0.5, 2.0 * n)[:dimensions], friction=0.5)
    world.create_entity(Transform((0.0, -0.5, 0.0)[:dimensions]), floor)
    if one_more:
        world.create_entity(Transform((-9.0, 99.0)), RigidBody(gravity_scale=0.0), Spin(1.0), SphereCollider(0.5))
    return world


def _standing(kind: Any, dimensions: int = 2) -> Any:
    return kind.many(half_extents=(0.5,) * dimensions, friction=0.5)


IN_3D = "boxes in flight, 3D"
RUNGS: tuple[Rung, ...] = (
    Rung("balls in flight", "", lambda n, seed: _balls(n, plugins=())),
    Rung("Rotation, nothing spins", "balls in flight", lambda n, seed: _balls(n)),
    Rung("balls with a Spin", "balls in flight", lambda n, seed: _balls(n, _spins())),
    Rung("boxes in flight", "", lambda n, seed: _flying(n)),
    Rung("boxes with a Spin", "boxes in flight", lambda n, seed: _flying(n, _spins())),
    Rung(IN_3D, "", lambda n, seed: _flying(n, dimensions=3)),
    Rung("boxes with a Spin, 3D", IN_3D, lambda n, seed: _flying(n, _spins(3), dimensions=3)),
    Rung("stacks of AABBs", "", lambda n, seed: _stacks(n, _standing(AABBCollider))),
    Rung(
        "and one ball that spins", "stacks of AABBs",
        lambda n, seed: _stacks(n, _standing(AABBCollider), one_more=True),
    ),
    Rung("stacks of boxes without a Spin", "stacks of AABBs", lambda n, seed: _stacks(n, _standing(BoxCollider))),
    Rung(
        "stacks of boxes with a Spin", "stacks of AABBs",
        lambda n, seed: _stacks(n, _standing(BoxCollider), Spin.many()),
    ),
    Rung("stacks of AABBs, 3D", "", lambda n, seed: _stacks(n, _standing(AABBCollider, 3), dimensions=3)),
    Rung(
        "stacks of boxes with a Spin, 3D", "stacks of AABBs, 3D",
        lambda n, seed: _stacks(n, _standing(BoxCollider, 3), Spin.many(), dimensions=3),
    ),
)  # fmt: skip
BY_FEATURE = {rung.feature: rung for rung in RUNGS}


def axes(quick: bool = False, long: bool = False) -> list[Axis]:
    """The scenes."""
    del long
    return [axis(FEW if quick else BODIES, by_feature=BY_FEATURE)]


def times(sample: Sample, beside: Sample) -> Spread:
    """The ratio to the scene beside it, within each repeat."""
    pairs = zip(sample.figures["ns"].values, beside.figures["ns"].values, strict=True)
    return Spread.of([one / other for one, other in pairs])


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """The scenes as a table."""
    (line,) = result.lines
    cells = []
    for sample in line.samples:
        beside = BY_FEATURE[sample.value].beside
        if beside:
            spread = times(sample, line.sample(beside))
            cells.append((sample.value, beside, compact(spread.median), span(spread)))
    title = f"times as long as the scene beside it, {line.of}; medians of {result.repeats}"
    return [TextTable(title, ("scene with", "beside", "times", "from .. to"), cells, words=2)], []
