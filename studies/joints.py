"""What substeps and shorter steps buy joints: gaps, energy and sag, and what they cost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from carom.components import RigidBody, Transform
from carom.framework import Settings, World
from carom.lab.measure.timing import Spread
from carom.lab.reporting.text import TextTable, compact
from carom.plugins import Physics
from carom.plugins.joints import Hinge, Joints, Weld
from carom.plugins.rotation import BoxCollider, Rotation, Spin

from .runner import Axis, Result, nanoseconds_per_step

SUBSTEPS, RATES = (1, 2, 4, 8, 16, 32), (30, 60, 120, 240)
USUAL = {"substeps": 4, "steps per second": 60}
CHAIN, BOXES = 20, 5
G, SECONDS = 9.81, 3.0  # s: the chain falls, swings and comes back
STEPS = 60  # that are timed


def _world(axis: str, value: int) -> tuple[World, Joints]:
    settings = Settings(substeps=value) if axis == "substeps" else Settings(dt=1.0 / value)
    joints = Joints()
    return World(Physics(dimensions=2, gravity=(0.0, -G)), Rotation(), joints, settings=settings), joints


def _row(world: World, joint: Any, count: int, half: float) -> list[int]:
    """Boxes of 1 m along x, each held by the one before, the first by the world."""
    bodies: list[int] = []
    for k in range(count):
        bodies.append(
            world.create_entity(Transform((k + 0.5, 0.0)), RigidBody(), BoxCollider((0.5, half)), Spin())
        )
        world.create_entity(joint(bodies[-2] if k else None, bodies[-1], anchor=(float(k), 0.0)))
    return bodies


def chain(axis: str, value: int) -> World:
    """Links that fall from the horizontal."""
    world, _ = _world(axis, value)
    _row(world, Hinge, CHAIN, 0.1)
    return world


def _found(axis: str, value: int) -> dict[str, Any]:
    """The worst gap of the chain, and by how much the end of welded boxes sinks; m."""
    gap = 0.0
    world, joints = _world(axis, value)
    with world:
        _row(world, Hinge, CHAIN, 0.1)
        for _ in range(round(SECONDS / world.settings.dt)):
            world.step()
            ends_a, ends_b = joints.anchors()
            gap = max(gap, float(np.linalg.norm(ends_b - ends_a, axis=1).max()))
    world, _ = _world(axis, value)
    with world:
        last = _row(world, Weld, BOXES, 0.5)[-1]
        for _ in range(round(SECONDS / world.settings.dt)):
            world.step()
        return {"gap": gap, "sinks": -world.component_for_entity(last, Transform).y}


def axes(quick: bool = False, long: bool = False) -> list[Axis]:
    """Both dials."""
    del long
    found = []
    for name, values in (("substeps", SUBSTEPS), ("steps per second", RATES)):

        def measure(value: int, repeat: int, name: str = name) -> Mapping[str, float]:
            rate = 60 if name == "substeps" else value
            return {"ns": rate * nanoseconds_per_step(lambda: chain(name, value), f"{name} {value}", STEPS)}

        of = f"{CHAIN} links that swing, {BOXES} boxes that are welded"
        values = values[1:4] if quick else values
        found.append(Axis(name, of, values, measure, lambda value, name=name: _found(name, value)))
    return found


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """A table for each dial."""
    tables = []
    for line in result.lines:
        usual, cells = line.sample(USUAL[line.axis]).figures["ns"].values, []
        for sample in line.samples:
            pairs = zip(sample.figures["ns"].values, usual, strict=True)
            times = Spread.of([one / other for one, other in pairs]).median
            facts = (f"{sample.facts[name]:.2g}" for name in ("gap", "sinks"))
            cells.append((str(sample.value), *facts, compact(times)))
        title = f"by {line.axis}: {line.of}; medians of {result.repeats}"
        head = (line.axis, "worst gap of a hinge, m", "the welded end sinks, m", "time per second, times")
        tables.append(TextTable(title, head, cells))
    return tables, []
