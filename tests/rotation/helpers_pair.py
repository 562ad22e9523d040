"""Two shapes in a world, and what they answer for any vector between their centres."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from carom.components import RigidBody, Transform
from carom.framework import World
from carom.framework.compilation import kernel
from carom.framework.jit.records.record_type import record_at, zero_of
from carom.framework.jit.stack_arrays import stack_array
from carom.framework.vectors import row, store
from carom.plugins import Physics, capsule, convex_hull, convex_polygon, half_space, tile_grid
from carom.plugins.half_space import HalfSpaceCollider
from carom.plugins.rotation import Rotation
from carom.plugins.tile_grid import TileGridCollider
from carom.systems.records import STATE
from carom.systems.shapes.convex.points import contact_points
from carom.systems.shapes.dispatch import evaluate

MARGIN, TILT = 0.02, 0.05
FAR = 1e11


@lru_cache
def look(d):
    state_at, zero = record_at(STATE, d), (0.0,) * d

    @kernel
    def points(address, a, b, way, within, met, places, gaps):
        state = state_at(address)
        apart, shape = row(way, 0, zero_of(state)), state.bodies.shape
        _, depth, normal, point = evaluate(state, shape[a], a, shape[b], b, apart)
        store(met, 0, normal)
        store(met, 1, point)
        gaps[4] = depth
        found, apart_by = stack_array(4, zero), stack_array(4, 0.0)
        count = contact_points(state, (a, b), apart, (depth, normal, point), (within[0], within[1]), found, apart_by)
        for k in range(count):
            store(places, k, row(found, k, apart))
            gaps[k] = apart_by[k]
        return count

    return points


class Pair:
    """Two shapes in a world, far from each other; what they answer for any vector between their centres."""

    def __init__(self, one, two, d, turn=None, margin=MARGIN, tilt=TILT):
        self.world = World(
            Physics(d, gravity=0), Rotation(), capsule.plugin, half_space.plugin,
            *([convex_polygon.plugin, tile_grid.plugin] if d == 2 else [convex_hull.plugin]),
        )  # fmt: skip
        self.d, self.within, rows = d, np.array((margin, tilt)), []
        turns = (None, None) if turn is None else turn
        for k, (shape, angle) in enumerate(zip((one, two), turns, strict=True)):
            ground = isinstance(shape, (HalfSpaceCollider, TileGridCollider))
            place = (np.eye(d)[0] * k + np.eye(d)[1] * (-1 if ground else 1)) * FAR
            body = [RigidBody(kind="static")] if ground else [RigidBody(1.0)]
            rows.append(
                self.world.create_entity(Transform(place, *(() if angle is None else (angle,))), *body, shape.copy())
            )
        self.world.step()
        table = self.world.physics.scene.table
        self.rows = [table.row_of(entity) for entity in rows]

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.world.close()

    def at(self, way, swapped=False):
        """(depth, normal, places, gaps), all relative to the centre of the first shape of the pair."""
        a, b = reversed(self.rows) if swapped else self.rows
        way, met, places, gaps = np.array([way], float), np.zeros((2, self.d)), np.zeros((4, self.d)), np.zeros(5)
        given = -way if swapped else way
        count = look(self.d)(self.world.physics.state.address, a, b, given, self.within, met, places, gaps)
        if swapped:
            return gaps[4], -met[0], places[:count] + way, gaps[:count]
        return gaps[4], met[0], places[:count], gaps[:count]

    def met(self, way):
        """(depth, normal, point) as the pair's function answers."""
        met, places, gaps = np.zeros((2, self.d)), np.zeros((4, self.d)), np.zeros(5)
        way = np.array([way], float)
        look(self.d)(self.world.physics.state.address, *self.rows, way, self.within, met, places, gaps)
        return gaps[4], *met

    def touching(self, way, gap=0.0):
        """That vector between the centres, moved along the normal until the gap is about so large."""
        for _ in range(4):
            depth, normal, _, _ = self.at(way)
            way = way + (depth + gap) * normal
        return way


def rotation(*vector):
    """A quaternion."""
    angle = np.linalg.norm(vector)
    return np.concatenate(([math.cos(angle / 2)], np.sinc(angle / 2 / math.pi) / 2 * np.array(vector)))


def product(p, q):
    """Of quaternions: the rotation q, then p."""
    return np.array((p[0] * q[0] - p[1:] @ q[1:], *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))))


def matrix(q):
    w, x, y, z = q
    return np.array((
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ))  # fmt: skip
