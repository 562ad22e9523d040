"""Copies of a world's state, going back to them, and a hash to compare by.

What a world's state is stands here, once: a snapshot, ``restore`` and a saved file are made of the same parts. Each
part is copied and put back by its owner.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..data.driven import STOPS
from ..data.saved.population import LooseValues, Population, PopulationRestore
from ..data.saved.table import SavedTable
from ..errors import CaromError
from .services import PhysicsServices


@dataclass
class Snapshot:
    """A world between two steps: what ``world.snapshot()`` returns and ``world.restore(snapshot)`` goes back to.

    It can be pickled, for another process or to keep: then components that are not carom's are pickled along.

    owner
        the physics of the world it was taken from; None after pickling
    dimensions, plugins
        of that world; the plugins' versions by name
    population, loose
        the entities and their components, and the values of those that are in no table
    dead, next_id
        entities whose deletion is pending; the id of the next one
    table, contacts, physics, kept, clock, steps
        the bodies' columns; the contacts as users see them; what physics, plugins (by name), clock and stats go on from
    """

    owner: PhysicsServices | None
    dimensions: int
    plugins: dict[str, str]
    population: Population
    loose: LooseValues
    dead: list[int]
    next_id: int
    table: SavedTable
    contacts: dict[str, Any]
    physics: dict[str, Any]
    kept: dict[str, Any]
    clock: tuple[float, ...]
    steps: int

    @classmethod
    def of(cls, world: Any, physics: PhysicsServices) -> Snapshot:
        """Of a world, with its ``physics``, whose table is up to date; shares with it what is not carom's."""
        contents = world._contents()
        population = Population.of(contents.entities, physics.adoption)
        kept = {plugin.name: plugin.saved(world) for plugin in world.plugins}
        saved = physics.saved()
        return cls(
            owner=physics, dimensions=physics.dimensions, plugins={p.name: p.version for p in world.plugins},
            population=population, loose=LooseValues.of(population, contents.entities), dead=list(contents.dead),
            next_id=contents.counter.next, table=SavedTable.of(physics.table),
            contacts=physics.contacts.saved(), physics=saved,
            kept={name: state for name, state in kept.items() if state is not None}, clock=world.clock.state(),
            steps=world._pipeline.profiler.steps,
        )  # fmt: skip

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "owner": None, "population": self.population.without_handles()}


def restore(snapshot: Snapshot, world: Any, physics: PhysicsServices) -> None:
    """Make the world what it was, whatever has come or gone since; its settings stay, dt too.

    CaromError, and nothing is changed, if the snapshot is of another kind of world.
    """
    restore_world(snapshot, world, physics)
    restore_plugins(snapshot, world)


def restore_world(snapshot: Snapshot, world: Any, physics: PhysicsServices) -> None:
    """All but what plugins keep."""
    _check(snapshot, world, physics)
    if snapshot.owner is not physics:
        snapshot = replace(snapshot, population=snapshot.population.without_handles())
    population, table, adoption = snapshot.population, physics.table, physics.adoption
    contents = world._contents()
    for component in (*snapshot.table.types, *population.types):
        adoption.know(component)
    for key in snapshot.table.columns:
        table.make(key)
    going = PopulationRestore(population, snapshot.table, contents, adoption)
    going.release()
    moved = snapshot.table.put_back(table)
    going.apply()
    contents.go_on_from(snapshot.next_id)
    snapshot.loose.put_into_handles(population, contents.entities)
    contents.dead.clear()
    contents.dead.update(snapshot.dead)
    clock, dt = world.clock, world.clock.dt
    clock.restore(snapshot.clock)
    clock.set_dt(dt)
    world._pipeline.profiler.steps = snapshot.steps
    physics.take_back(snapshot.physics, moved)
    physics.contacts.take_back(snapshot.contacts)


def restore_plugins(snapshot: Snapshot, world: Any) -> None:
    for plugin in world.plugins:
        if plugin.name in snapshot.kept:
            plugin.take_back(world, snapshot.kept[plugin.name])


def _check(snapshot: Snapshot, world: Any, physics: PhysicsServices) -> None:
    if snapshot.dimensions != physics.dimensions:
        raise CaromError(
            f"this snapshot is of a world of {snapshot.dimensions} dimensions; world {world.name!r} has "
            f"{physics.dimensions}"
        )
    here = {plugin.name for plugin in world.plugins}
    missing = [name for name in snapshot.plugins if name not in here]
    if missing:
        raise CaromError(f"this snapshot needs plugins that world {world.name!r} does not have: {', '.join(missing)}")
    for component in (*snapshot.table.types, *snapshot.population.types):
        physics.table.check_component_types((component,))


def state_hash(physics: PhysicsServices) -> str:
    """Of all values of all bodies' components, in order of the entity ids; 0.0 and -0.0 are the same."""
    physics.notice_written()
    table = physics.table
    order = np.argsort(table.column("entity"), kind="stable")
    digest = hashlib.sha256(table.column("entity")[order].tobytes())
    present = [c for c in table.component_types if table.has_mask(c)[: table.count].any()]
    for component in sorted(present, key=table.mask_name):
        mask = table.mask_name(component)
        columns = {column.key: column.hashable(table.column(column.key)) for column in component.columns.values()}
        for key, values in {mask: table.column(mask), **columns}.items():
            digest.update(key.encode())
            zero = np.int64(0) if values.dtype == bool else 0  # numpy's own integer has another size elsewhere
            digest.update(np.ascontiguousarray(values[order] + zero).tobytes())
    for column in (table.asleep(slice(0, table.count)), table.column(STOPS)):
        if column.any():
            digest.update(column[order].tobytes())
    return digest.hexdigest()
