"""What is drawn over the shapes: joints, contacts, velocities, the boxes of the broad phase."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..framework.outlines import SIGNS
from ..plugins.joints import Joints
from .lists import Floats, Lines, Points, Style
from .shapes import Places

NORMAL = 0.5  # length of normals, of the median half extent of the boxes
SECONDS = 0.1  # that velocities are drawn for
EDGES = {  # of a box: pairs of corners
    2: np.array(((0, 1), (1, 2), (2, 3), (3, 0))),
    3: np.array([(a, b) for a in range(8) for b in range(8) if b - a in (1, 2, 4) and not a & (b - a)]),
}


def joint_marks(world: Any, lines: list[Lines], points: list[Points]) -> None:
    """A line between both anchors of each joint, and a point at each."""
    for joints in world.plugins:
        if isinstance(joints, Joints):
            entity, ends = joints.entities, np.stack(joints.anchors(), axis=1)
            lines.append(_lines(ends, Style.JOINT, entity))
            points.append(_points(ends.reshape(-1, ends.shape[2]), Style.JOINT, np.repeat(entity, 2)))


def contact_marks(world: Any, lines: list[Lines], points: list[Points]) -> None:
    """A point at each contact and its normal, of the first of its bodies."""
    contacts = world.contacts
    at, entity = np.array(contacts.point), np.array(contacts.entity_a)
    half = _half_extents(world, slice(0, world.physics.table.stops[1]))
    half = half[np.isfinite(half) & (half > 0.0)]
    size = np.median(half) if len(half) else 1.0
    points.append(_points(at, Style.CONTACT, entity))
    lines.append(_lines(np.stack((at, at + NORMAL * size * contacts.normal), axis=1), Style.NORMAL, entity))


def velocity_lines(places: Places, velocity: Floats) -> Lines:
    ends = np.stack((places.position, places.position + SECONDS * velocity), axis=1)
    return _lines(ends, Style.VELOCITY, places.entity)


def box_lines(world: Any, moving: int) -> Lines:
    """The boxes of the moving bodies in which the broad phase has looked for others in the last step."""
    boxes = world.physics.state.bodies
    lower, upper = boxes.lower[:moving], boxes.upper[:moving]
    there = np.isfinite(upper - lower).all(axis=1)
    middle, half = (lower[there] + upper[there]) / 2.0, (upper[there] - lower[there]) / 2.0
    d = middle.shape[1]
    corners = middle[:, None] + SIGNS[d] * half[:, None]
    entity = world.physics.table.column("entity")[:moving][there]
    return _lines(corners[:, EDGES[d]].reshape(-1, 2, d), Style.BOX, np.repeat(entity, len(EDGES[d])))


def _half_extents(world: Any, rows: slice) -> Floats:
    boxes = world.physics.state.bodies
    return (boxes.upper[rows] - boxes.lower[rows]).max(axis=1) / 2.0


def _lines(ends: Floats, style: Style, entity: Any) -> Lines:
    return Lines(ends, np.full(len(ends), style, np.int8), np.array(entity, np.int64))


def _points(at: Floats, style: Style, entity: Any) -> Points:
    return Points(at, np.full(len(at), style, np.int8), np.array(entity, np.int64))
