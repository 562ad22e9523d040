"""The rows of joints in the record of the solver, by the entities of the joints: a change writes what it changes."""

from __future__ import annotations

import bisect
import math
from typing import Any

import numpy as np

from ...framework import PluginError
from ...framework.jit.lazy import is_of_compiler
from ...framework.jit.records.schema import Column
from ...systems.joints.own import custom_numbers, linked_joint
from ...systems.joints.records import CUSTOM, JOINTS
from .joint import WORLD, Joint, Row

# What rows are known by, what they are made of, and what they keep from step to step, those of plugins more.
KEY = ("joint", "kind", "rule", "entity_a", "entity_b")
NUMBERS = ("low", "high", "target", "most", "frequency", "damping_ratio")
MADE = ("anchor_a", "anchor_b", "axis", *NUMBERS, "breaking_force", "breaking_torque", "function", "part", "numbers_at")
KEPT = ("load", "pull", "normal", "total", "thrust", "value")
OF_PLUGINS = ("along_a", "turn_a", "turn_b")
MOVED = (*KEY, *MADE, *KEPT, *OF_PLUGINS)
# Columns that have no row for each row of a joint.
APART, OWN = ("apart_a", "apart_b"), ("numbers", "axes_a", "axes_b")
PER_ROW = [n for n, field in JOINTS.fields.items() if isinstance(field, Column) and n not in (*APART, *OWN)]


class JointRows:
    """Writes the record of one world."""

    def __init__(self, record: Any, dimensions: int, registry: Any) -> None:
        self._record, self._dimensions, self._registry = record, dimensions, registry
        self._pairs: dict[int, tuple[int, int]] = {}  # by joint, the bodies that it keeps from touching
        self._places: dict[int, slice] = {}  # by joint of a plugin, its fields in ``numbers``
        self._free: list[slice] = []  # of those that are gone
        self._first = np.eye(dimensions)[0]

    def span(self, entity: int) -> slice:
        """The rows of a joint; where they would be, if it has none."""
        joints, count = self._record.joint, self._record.count
        start = bisect.bisect_left(joints, entity, 0, count)
        return slice(start, bisect.bisect_right(joints, entity, start, count))

    def put(self, joint: Joint, rows: list[Row], fresh: bool) -> tuple[set[int], bool]:
        """The rows of a joint as it is now; those that it has had, of the same two bodies, go on from there, and its
        angle unless it has just taken hold. Returns the bodies that it holds, or has held, and whether these are other
        rows."""
        record, span = self._record, self.span(joint.entity)
        address = self._link(joint) if type(joint) in self._registry.joints else 0
        bodies, now = {joint.a, joint.b}, [(row.kind, row.rule, joint.a, joint.b) for row in rows]
        before = list(zip(*(getattr(record, name)[span].tolist() for name in KEY[1:]), strict=True))
        if before != now:
            bodies.update(*(row[2:] for row in before))
            had = by_row({name: getattr(record, name)[span].copy() for name in (*KEY, *KEPT, *OF_PLUGINS)})
            span = self.lay(joint, now)
            put_kept(record, span, had)
        if fresh and rows and rows[0].kind != CUSTOM:
            record.value[span.start] = 0.0
        if address:
            self._put_own(joint, span, rows, address)
        anchors = joint.at_a, joint.at_b
        anchor_a, anchor_b, axis = record.anchor_a, record.anchor_b, record.axis
        for j, row in enumerate(rows, span.start):
            anchor_a[j], anchor_b[j] = row.ends or anchors
            axis[j] = self._first if row.axis is None else row.axis
        for name in NUMBERS:
            column = getattr(record, name)
            for j, row in enumerate(rows, span.start):
                column[j] = getattr(row, name)
        record.breaking_force[span] = joint.breaking_force or math.inf
        record.breaking_torque[span] = joint.breaking_torque or math.inf
        return bodies, before != now

    def lay(self, joint: Joint, keys: list[Any]) -> slice:
        """Rows that are known by these: kind, rule, entity a and entity b."""
        record, entity, span = self._record, joint.entity, self._make_room(self.span(joint.entity), len(keys))
        for j, key in enumerate(keys, span.start):
            record.joint[j], (record.kind[j], record.rule[j], record.entity_a[j], record.entity_b[j]) = entity, key
            record.breaking_force[j] = record.breaking_torque[j] = math.inf
        return span

    def put_back(self, saved: dict[str, Any]) -> list[int]:
        """The rows go on from what was ``saved`` of them; the bodies of those that were others then."""
        record = self._record
        self._changed(count := record.count)
        if all(np.array_equal(getattr(record, name)[:count], saved[name]) for name in KEY):
            for name in (*KEPT, *OF_PLUGINS):
                getattr(record, name)[:count] = saved.get(name, 0.0)
            return []
        had = by_row(saved)
        now = put_kept(record, slice(0, count), had)
        return [body for key in had.keys() ^ now for body in key[3:5]]

    def remove(self, entities: list[int]) -> None:
        """These joints have no rows any more."""
        record = self._record
        spans = [self.span(entity) for entity in entities]  # ascending, as their rows
        start, left = spans[0].start, record.count - sum(span.stop - span.start for span in spans)
        source: Any = slice(spans[0].stop, record.count)
        if len(spans) > 1:
            stays = np.ones(record.count, bool)
            for span in spans:
                stays[span] = False
            source = np.flatnonzero(stays)[start:]
        for name in MOVED if left > start else ():
            column = getattr(record, name)
            column[start:left] = column[source]
        self._changed(left)
        for entity in entities:
            self._part(entity)
            if entity in self._places:
                self._free.append(self._places.pop(entity))

    def _make_room(self, span: slice, size: int) -> slice:
        """So many rows in place of those; the ones behind move."""
        record, stop = self._record, span.start + size
        count = record.count + stop - span.stop
        if count > len(record.joint):
            record.reserve(2 * count, *PER_ROW)
        if span.stop < record.count:
            for name in MOVED:
                column = getattr(record, name)
                column[stop:count] = column[span.stop : record.count]
        self._changed(count)
        return slice(span.start, stop)

    def _changed(self, count: int) -> None:
        """The solver looks for their bodies again; nothing that was kept before a step is of these rows."""
        record = self._record
        record.count, record.active, record.rows_version, record.kept_in = count, 0, -1, 0

    def _link(self, joint: Joint) -> int:
        """The address of the function of a plugin's joint; a PluginError if it cannot be compiled."""
        own = self._registry.joints[type(joint)]
        try:
            return linked_joint(own, self._dimensions).address
        except Exception as error:
            if not is_of_compiler(error):
                raise
            raise PluginError(
                f"plugin {own.plugin}: constraint of joint {type(joint).__name__} cannot be compiled; use numbers, "
                f"tuples, math, carom.framework.vectors, and helpers marked @plugin.kernel: {error}"
            ) from error

    def _put_own(self, joint: Joint, span: slice, rows: list[Row], address: int) -> None:
        """What rows of a plugin's joint call, and its fields."""
        record, entity, given = self._record, joint.entity, custom_numbers(joint, self._dimensions)
        if entity not in self._places:
            free = next((place for place in self._free if place.stop - place.start == len(given)), None)
            end = max((place.stop for place in (*self._places.values(), *self._free)), default=0)
            if free is not None:
                self._free.remove(free)
            self._places[entity] = free or slice(end, end + len(given))
            record.reserve(2 * (end + len(given)), "numbers")
        record.reserve(self._dimensions * len(record.joint), "axes_a", "axes_b")
        record.numbers[self._places[entity]] = given
        for j, row in enumerate(rows, span.start):
            if row.kind == CUSTOM:
                record.function[j], record.part[j], record.numbers_at[j] = address, row.part, self._places[entity].start

    # -- bodies that joints keep from touching ----------------------------------------------------

    def keep_apart(self, joint: Joint, ends: list[int]) -> None:
        """The joint keeps the whole bodies ``ends`` from touching, if it does that."""
        pair = None if joint.collide_connected or WORLD in ends else (min(ends), max(ends))
        if self._pairs.get(joint.entity) == pair:
            return
        self._part(joint.entity)
        if pair is not None:
            self._pairs[joint.entity] = pair
            self._shift(pair, 1)

    def _part(self, entity: int) -> None:
        """The joint keeps nothing apart any more."""
        pair = self._pairs.pop(entity, None)
        if pair is not None:
            self._shift(pair, -1)

    def _shift(self, pair: tuple[int, int], by: int) -> None:
        """One pair more in their order, or one less."""
        record, n = self._record, self._record.apart
        if n == len(record.apart_a):
            record.reserve(2 * n + 8, *APART)
        a, b = record.apart_a, record.apart_b
        low, high = np.searchsorted(a[:n], (pair[0], pair[0] + 1)).tolist()
        at = low + int(np.searchsorted(b[low:high], pair[1]))
        for column, value in ((a, pair[0]), (b, pair[1])):
            if by > 0:
                column[at + 1 : n + 1] = column[at:n]
                column[at] = value
            else:
                column[at : n - 1] = column[at + 1 : n]
        record.apart = n + by


def by_row(columns: dict[str, Any]) -> dict[tuple[int, ...], tuple[Any, ...]]:
    """What rows keep, by what they are known by and how many such rows are before them."""
    rows: dict[tuple[int, ...], tuple[Any, ...]] = {}
    seen: dict[tuple[int, ...], int] = {}
    kept = [np.asarray(columns[name]) for name in (*KEPT, *OF_PLUGINS) if name in columns]
    for j, key in enumerate(zip(*(np.asarray(columns[name]).tolist() for name in KEY), strict=True)):
        seen[key] = seen.get(key, -1) + 1
        rows[*key, seen[key]] = tuple(column[j] for column in kept)
    return rows


def put_kept(record: Any, span: slice, had: dict[tuple[int, ...], tuple[Any, ...]]) -> list[tuple[int, ...]]:
    """These rows begin with what others had that are known by the same, or with nothing; returns by what."""
    for name in (*KEPT, *OF_PLUGINS):
        getattr(record, name)[span] = 0.0
    record.normal[span] = np.eye(record.dimensions)[0]
    keys = list(by_row({name: getattr(record, name)[span] for name in KEY}))
    angles = {key[0]: kept[KEPT.index("value")] for key, kept in reversed(had.items())}
    for j, key in enumerate(keys, span.start):  # whatever rows it has now: the angle stays with the joint
        if key[1] != CUSTOM and (j == span.start or key[0] != record.joint[j - 1]):
            record.value[j] = angles.get(key[0], 0.0)
    for j, key in enumerate(keys, span.start):
        for name, value in zip((*KEPT, *OF_PLUGINS), had.get(key, ()), strict=False):
            getattr(record, name)[j] = value
    return keys
