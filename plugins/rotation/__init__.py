"""Bodies that spin: ``World(Physics(...), Rotation())``, then ``Spin(...)`` on them, and boxes that turn."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...components.part_of import PartOf
from ...components.spin import Spin
from ...framework import Plugin, World
from .box import BoxCollider
from .box_pairs import boxes
from .stages import spinning


class Rotation(Plugin):
    """Rotational dynamics for the bodies that have a :class:`Spin`; all others are as without it."""

    def __init__(self) -> None:
        super().__init__("rotation", version="1.0")
        self.shapes, self.pairs, self.stages = dict(boxes.shapes), dict(boxes.pairs), dict(spinning.stages)

    def install(self, world: World) -> None:
        super().install(world)
        if world.physics is not None:
            slips = Slips(world.physics.table)
            world.physics.plugin_stages.followers.append(slips)
            world.physics.plugin_stages.waiting.append(slips.waits)


class Slips:
    """Tells of bodies that do not turn as they are, though somebody may think so."""

    def __init__(self, table: Any) -> None:
        self._table, self._seen, self._boxes_told = table, -1, False
        # Kinematic bodies whose rotation was assigned before the last step: the new one, and whether it differed.
        self._turned: dict[int, tuple[Any, bool]] = {}

    def __call__(self, world: World) -> None:
        table = self._table
        self._tell_of_flippers(world)
        seen = table.version + table.members_version  # these only grow
        if seen == self._seen:
            return
        self._seen, entity = seen, table.column("entity")
        moves, free = slice(table.stops[0]), slice(table.stops[1], table.count)
        for row in np.flatnonzero(self._has(Spin)[free]).tolist():
            if np.any(table.column("spin.angular_velocity")[free][row]):
                world.report_fault(
                    f"entity {entity[free][row]}: a static body does not turn by its Spin: "
                    f'RigidBody(kind="kinematic") does',
                    kind="spin of a static body", entity=int(entity[free][row]),
                )  # fmt: skip
        boxes = self._has(BoxCollider)[moves] & ~self._has(Spin)[moves] & ~self._has(PartOf)[moves]
        if boxes.any() and not self._boxes_told:
            self._boxes_told = True
            world.report_fault(
                f"entity {entity[moves][boxes.argmax()]}: a dynamic body with a BoxCollider and no Spin never turns: "
                f"give it a Spin(), or an AABBCollider if it is not to turn"
            )

    def _tell_of_flippers(self, world: World) -> None:
        """What a game turns step by step, while something touches it, pushes as if it stood still."""
        table, spins, now = self._table, self._has(Spin), {}
        for entity in sorted(table.turned):
            row = table.row_of(entity)
            if row < 0 or spins[row]:
                continue
            rotation = table.column("rotation")[row].tolist()
            before, again = self._turned.get(entity, (rotation, False))
            now[entity] = rotation, before != rotation
            if before != rotation and again and world.contacts.of(entity):
                world.report_fault(
                    f"entity {entity}: a kinematic body whose Transform.rotation is set in each step, now {rotation}, "
                    f"pushes as if its surface stood still: give it a Spin, and set angular_velocity",
                    kind="turned by hand", entity=entity,
                )  # fmt: skip
        self._turned = now
        table.turned.clear()

    def waits(self) -> bool:
        """Whether there is something to look at that shows in no version."""
        return bool(self._table.turned or self._turned)

    def _has(self, component: type[Any]) -> np.ndarray:
        table = self._table
        known = component in table.mask_names
        return table.has_mask(component)[: table.count] if known else np.zeros(table.count, bool)


__all__ = ["BoxCollider", "Rotation", "Spin"]
