"""``Drawing(world).update()``: the drawing list of a world, frame by frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..components.spin import Spin
from ..framework import World
from .lists import DrawingList, Style
from .outline_cache import OutlineCache
from .overlays import box_lines, contact_marks, joint_marks, velocity_lines
from .shapes import Places, arrays_of, parts_of, shapes_at, watched_of

KNOWN, SPARE = 1000, 4  # outlines that are kept for all that, and for each body: if more are known, all are made again


class Drawing:
    """Makes the :class:`DrawingList` of one world. What stays from frame to frame, outlines and all that is static, is
    made once.

    NoPhysicsError for a world without physics.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        world.bodies  # noqa: B018 - raises without physics
        self._physics: Any = world.physics
        self._cache = OutlineCache(self._physics.dimensions)
        self._version: Any = None
        self._moving: Any = None
        self._moving_seen: dict[str, bytes] = {}
        self._fixed: Any = None
        self._fixed_seen: dict[str, bytes] = {}
        self._arrays_seen: dict[str, bytes] = {}
        self._fixed_version = 0
        self._statics: Any = None

    def update(
        self, *, joints: bool = True, contacts: bool = False, velocities: bool = False, boxes: bool = False,
        interpolated: bool = True,
    ) -> DrawingList:  # fmt: skip
        """The world as it is now.

        joints
            whether lines lead from the bodies to the anchors of their joints
        contacts
            whether points and normals of the contacts of the last step are shown
        velocities
            whether lines show where bodies will be in a tenth of a second
        boxes
            whether boxes of the broad phase are shown
        interpolated
            whether bodies are between the last two steps, by ``world.alpha``; False: where the last step has left them
        """
        world, table = self.world, self._physics.table
        world.bodies  # noqa: B018 - brings the table up to date
        moving, count = table.stops[1], table.count
        self._follow(table, slice(0, moving), slice(moving, count))
        places = self._places(slice(0, moving), interpolated)
        polygons, circles, capsules, lines = shapes_at(self._moving, places)
        fixed, fixed_circles, fixed_capsules, fixed_lines = self._fixed
        points = []
        if joints:
            joint_marks(world, lines, points)
        if velocities:
            lines.append(velocity_lines(places, table.column("linear_velocity")[:moving]))
        if contacts:
            contact_marks(world, lines, points)
        if boxes:
            lines.append(box_lines(world, moving))
        return DrawingList(
            self._cache.dimensions, polygons, circles, capsules, lines, points,
            fixed, fixed_circles, fixed_capsules, fixed_lines, self._fixed_version,
        )  # fmt: skip

    def _follow(self, table: Any, rows: slice, still: slice) -> None:
        """Make again what has changed since the last frame, but for where moving bodies are."""
        world, version = self.world, (table.version, table.members_version, self.world.registry.version)
        now = watched_of(world, rows)
        if self._moving is None or version != self._version or now != self._moving_seen:
            if len(self._cache.outlines) > KNOWN + SPARE * table.count:
                self._cache = OutlineCache(table.dimensions)
            self._moving, self._moving_seen = parts_of(world, self._cache, rows), now
        statics, arrays = (version, table.static_version, self._physics.state.statics_version), arrays_of(world, still)
        if statics != self._statics or arrays != self._arrays_seen:
            now = watched_of(world, still) | {
                key: table.column(key)[still].tobytes() for key in ("position", "rotation")
            }
            if self._fixed is None or now != self._fixed_seen:
                self._fixed = shapes_at(parts_of(world, self._cache, still), self._places(still, False))
                self._fixed_seen = now
                self._fixed_version += 1
            self._arrays_seen = arrays
        self._version, self._statics = version, statics

    def _places(self, rows: slice, interpolated: bool) -> Places:
        """Where the bodies of these rows are."""
        bodies, table = self.world.bodies, self._physics.table
        if interpolated:
            position, angle = bodies.interpolated_position[rows], bodies.interpolated_rotation[rows]
        else:
            position, angle = table.column("position")[rows].copy(), table.column("rotation")[rows].copy()
        spins = table.has_mask(Spin)[rows].copy() if Spin in table.mask_names else np.zeros(len(position), bool)
        return Places.of(rows.start, position, angle, self._styles(table, rows), table.column("entity")[rows], spins)

    def _styles(self, table: Any, rows: slice) -> NDArray[np.int8]:
        dynamic, moving = table.stops[0], table.stops[1]
        style = np.full(rows.stop - rows.start, Style.STATIC, np.int8)
        style[: max(0, moving - rows.start)] = Style.KINEMATIC
        style[: max(0, dynamic - rows.start)] = Style.DYNAMIC
        style[table.asleep(rows)] = Style.ASLEEP
        return style
