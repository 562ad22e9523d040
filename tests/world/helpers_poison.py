"""Values that cannot be, written into columns: which columns there are, and what the other bodies do.

``PYTHONPATH=tests python -m world.helpers_poison`` writes such values into every column of every body of small worlds;
it is meant for the checked build (CAROM_CHECK=1), which raises where a kernel leaves its arrays. With ``7 all``: every
value, into the columns of every seventh body; with ``7 2D``: two values of each, without the worlds in 3D.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator

import numpy as np
from helpers_zoo import MODES, mixed, platformer, tumbling

from carom.framework import World
from carom.plugins.rotation import Spin

VALUES = (math.nan, math.inf, -math.inf, -1.0)
# Made in every step, or cleared where a frame ends.
MADE = {"force", "inverse_mass", "previous_position", "applied_force", "spin.applied_torque"}
BEFORE, AFTER = 8, 6  # steps


def column_of(world: World, name: str) -> np.ndarray:
    """The column, which may be of a component: ``sphere_collider.radius``."""
    view = world.bodies
    for part in name.split("."):
        view = getattr(view, part)
    return view


def columns_in(world: World) -> list[str]:
    """The names of all columns that a game may write numbers into."""
    names = [name for name in world.bodies.column_names() if name not in MADE]
    return [name for name in names if column_of(world, name).flags.writeable and column_of(world, name).dtype != bool]


def poison(world: World, name: str, entity: int, value: float) -> bool:
    """Write the value into an entity's row; False if the column holds whole numbers and this is none."""
    column, row = column_of(world, name), world.bodies.row_of(entity)
    if column.dtype != float and not math.isfinite(value):
        return False
    column[row] = value
    return True


def rest_of(world: World, entity: int) -> list[bytes]:
    """Where the other bodies are, how they are turned and how fast, in order of their ids."""
    bodies = world.bodies
    order = np.argsort(bodies.entity)
    order = order[bodies.entity[order] != entity]
    names = ["position", "linear_velocity", "rotation", *["spin.angular_velocity"] * int(bodies.has(Spin).any())]
    return [column_of(world, name)[order].tobytes() for name in names]


def told(world: World) -> list[str]:
    """The faults that name an entity."""
    return [fault for fault in world.faults if fault.startswith("entity ")]


def without(build, entity: int) -> list[list[bytes]]:
    """What the others do, step by step, after that entity was deleted."""
    world = build()
    for _ in range(BEFORE):
        world.step()
    world.delete_entity(entity)
    found = []
    for _ in range(AFTER):
        world.step()
        found.append(rest_of(world, entity))
    world.close()
    return found


def complaints(build, victims: slice = slice(None), first: int | None = None) -> Iterator[str]:
    """What goes wrong when such values are written, an entity and column at a time; first: two values in turn."""
    world = build()
    for _ in range(BEFORE):
        world.step()
    names, entities = columns_in(world), sorted(world.bodies.entity.tolist())
    start = world.snapshot()
    for number, entity in enumerate(entities[victims]):
        expected = without(build, entity)
        for place, name in enumerate(names):
            for value in VALUES if first is None else VALUES[(first + number + place) % 2 :: 2]:
                world.restore(start)
                world.faults.clear()
                if poison(world, name, entity, value):
                    what = f"{name} of entity {entity} = {value}"
                    found = []
                    for _ in range(AFTER):
                        world.step()
                        found.append(rest_of(world, entity))
                    faults = told(world)
                    if not all(np.isfinite(np.frombuffer(part)).all() for parts in found for part in parts):
                        yield f"{what}: others are not finite"
                    if len(faults) > 1 or any(f"entity {entity}: {name} is" not in fault for fault in faults):
                        yield f"{what}: {faults}"
                    if faults and found != expected:
                        yield f"{what}: others are not as if it had been deleted"
    world.close()


def scenes() -> Iterator[tuple[str, object]]:
    for mode in MODES:
        for d in (2, 3):
            yield f"mixed {d}D {mode}", lambda d=d, mode=mode: mixed(d, mode)
            yield f"tumbling {d}D {mode}", lambda d=d, mode=mode: tumbling(d, mode)
        yield f"platformer {mode}", lambda mode=mode: platformer(mode)


if __name__ == "__main__":
    share = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    chosen = [(name, build) for name, build in scenes() if "2D" not in sys.argv or "3D" not in name]
    for number, (name, build) in enumerate(chosen):
        for complaint in complaints(build, slice(number % share, None, share), None if "all" in sys.argv else number):
            print(f"{name}: {complaint}")
