"""What substeps and shorter steps buy joints: gaps and sag, and what they cost."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from carom.components import RigidBody, Transform
from carom.framework import Settings, World
from carom.lab.reporting.text import TextTable, compact
from carom.plugins import Physics
from carom.plugins.joints import Hinge, Joints, Weld
from carom.plugins.rotation import BoxCollider, Rotation, Spin

from .runner import Axis, Result, nanoseconds_per_step, ratios

DIALS = {"substeps": (1, 2, 4, 8, 16, 32), "steps per second": (30, 60, 120, 240)}
USUAL = {"substeps": 4, "steps per second": 60}
CHAIN, BOXES = 20, 5
SECONDS, STEPS = 3.0, 60  # the chain falls, swings and comes back; steps that are timed


def _row(joint: Any, count: int, half: float, dial: str, value: int) -> tuple[World, Joints]:
    """Boxes of 1 m along x, each held by the one before, the first by the world."""
    settings = Settings(substeps=value) if dial == "substeps" else Settings(dt=1.0 / value)
    joints, before = Joints(), None
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), Rotation(), joints, settings=settings)
    for k in range(count):
        body = world.create_entity(Transform((k + 0.5, 0.0)), RigidBody(), BoxCollider((0.5, half)), Spin())
        world.create_entity(joint(before, body, anchor=(float(k), 0.0)))
        before = body
    return world, joints


chain, beam = partial(_row, Hinge, CHAIN, 0.1), partial(_row, Weld, BOXES, 0.5)


def _facts(dial: str, value: int) -> dict[str, float]:
    """The worst gap of the chain, and by how much the end of welded boxes sinks; m."""
    gap = 0.0
    world, joints = chain(dial, value)
    with world:
        for _ in range(round(SECONDS / world.settings.dt)):
            world.step()
            gap = max(gap, float(np.linalg.norm(np.subtract(*joints.anchors()), axis=1).max()))
    world, _ = beam(dial, value)
    with world:
        for _ in range(round(SECONDS / world.settings.dt)):
            world.step()
        return {"gap": gap, "sinks": -float(world.bodies.position[-1, 1])}


def _time(dial: str, value: int, repeat: int) -> dict[str, float]:
    """Nanoseconds of a second of the chain."""
    rate = 60 if dial == "substeps" else value
    return {"ns": rate * nanoseconds_per_step(lambda: chain(dial, value)[0], f"{dial} {value}", STEPS)}


def axes(quick: bool = False) -> list[Axis]:
    """Both dials."""
    of = f"{CHAIN} links that swing, {BOXES} boxes that are welded"
    return [
        Axis(dial, of, values[1:4] if quick else values, partial(_time, dial), partial(_facts, dial))
        for dial, values in DIALS.items()
    ]


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """A table for each dial."""
    tables = []
    for line in result.lines:
        usual = line.sample(USUAL[line.axis]).figures["ns"]
        cells = [
            (str(sample.value), f"{sample.facts['gap']:.2g}", f"{sample.facts['sinks']:.2g}",
             compact(ratios(sample.figures["ns"], usual).median))
            for sample in line.samples
        ]  # fmt: skip
        head = (line.axis, "worst gap of a hinge, m", "the welded end sinks, m", "time per second, times")
        tables.append(TextTable(f"by {line.axis}: {line.of}; medians of {result.repeats}", head, cells))
    return tables, []
