"""``world.contacts``: the contacts of the last step, and what began, stayed, ended or struck since the window opened.

A window is one ``step()`` or one ``advance()``: begin, end and impacts hold everything that happened in it, with the
number of the step, so that what a game does with them never depends on its frame rate.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from ..data.esper_bridge import Membership

VECTORIZED_MIN = 32  # rows; fewer are looked at one by one in less time than masks take
BLOCK = 256  # records made at once; one that a game keeps also keeps the points and normals of its block


@dataclass(frozen=True, slots=True)
class ContactFields:
    """The fields of a contact: entity_a, entity_b, point, normal, depth, normal_impulse, step, time_of_impact are the
    values of one row of :class:`ContactRows`, point and normal (d,)."""

    entity_a: int
    entity_b: int
    point: np.ndarray
    normal: np.ndarray
    depth: float
    normal_impulse: float
    step: int
    time_of_impact: float  # nan if this is no impact


class Contact(ContactFields):
    """One contact, seen from ``entity_a``: the normal points from a to b."""

    __slots__ = ()

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(
            f"a contact is a copy of its row, {name} cannot be set; write the columns: "
            "world.contacts.enabled[i] = False"
        )

    def flipped(self) -> Contact:
        """The same contact seen from the other body."""
        return Contact(
            self.entity_b, self.entity_a, self.point, -self.normal, self.depth, self.normal_impulse, self.step,
            self.time_of_impact,
        )  # fmt: skip


_WRITE_FIELD = [getattr(ContactFields, field.name).__set__ for field in fields(ContactFields)]


def make_contacts(count: int, *columns: Iterable[Any]) -> list[Contact]:
    """``Contact(...)`` of each row of the columns, one column after the other: twice as fast."""
    contacts = list(map(object.__new__, itertools.repeat(Contact, count)))
    for write, column in zip(_WRITE_FIELD, columns, strict=True):
        deque(map(write, contacts, column), maxlen=0)  # the loop runs in C
    return contacts


class ContactsBetween(NamedTuple):
    """The contacts between entities with one component and entities with another: k rows, ascending.

    rows
        (k,) places in the columns of the list that was asked: ``contacts.depth[found.rows]``
    a, b
        (k,) ids: a has the first component, b the second
    """

    rows: np.ndarray
    a: np.ndarray
    b: np.ndarray


def _check_types(verb: str, *components: Any) -> None:
    """TypeError for what is no component type: nothing would match it."""
    for component in components:
        if not isinstance(component, type):
            raise TypeError(f"{verb} takes component types, got {component!r}")


class ContactRows:
    """Columns of contacts or contact events, rows ordered by (entity_a, entity_b), entity_a < entity_b.

    entity_a, entity_b (m,) ids; point, normal (m, d); depth (m,) overlap in metres; normal_impulse (m,) in N s;
    step (m,); time_of_impact (m,) seconds since the start of the step, for impacts.
    """

    def __init__(self, columns: dict[str, np.ndarray], membership: Callable[[], Membership]) -> None:
        self._own_columns = columns
        self._membership = membership

    @property
    def _columns(self) -> dict[str, np.ndarray]:
        return self._own_columns

    def __len__(self) -> int:
        return len(self._columns["entity_a"])

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._columns[name]
        except KeyError:
            raise AttributeError(f"contacts have no column {name!r}; they have {', '.join(self._columns)}") from None

    def row(self, index: int) -> Contact:
        """The row ``index`` as one record."""
        c = self._columns
        return Contact(
            c["entity_a"].item(index), c["entity_b"].item(index), c["point"][index].copy(), c["normal"][index].copy(),
            c["depth"].item(index), c["normal_impulse"].item(index), c["step"].item(index),
            c["time_of_impact"].item(index) if "time_of_impact" in c else math.nan,
        )  # fmt: skip

    def __iter__(self) -> Iterator[Contact]:
        c = self._columns
        names = ("entity_a", "entity_b", "depth", "normal_impulse", "step")
        a, b, depth, impulse, step = (c[name].tolist() for name in names)
        times = c["time_of_impact"].tolist() if "time_of_impact" in c else itertools.repeat(math.nan)
        return map(Contact, a, b, c["point"].copy(), c["normal"].copy(), depth, impulse, step, times)

    def pairs(self, first: type[Any], second: type[Any]) -> Iterator[tuple[int, int, Contact]]:
        """(a, b, contact) for contacts of an entity that has ``first`` with one that has ``second``.

        The contact is oriented from a to b. Entities that have been deleted meanwhile are skipped, also those deleted
        while iterating; so are contacts that are not enabled. :meth:`between` gives the same as columns. TypeError if
        one of the two is no type.
        """
        _check_types("pairs", first, second)
        return self._pairs(first, second)

    def _pairs(self, first: type[Any], second: type[Any]) -> Iterator[tuple[int, int, Contact]]:
        seen, start = ContactRows(self._columns, self._membership), 0  # its columns stay when the loop takes a step
        if not len(seen):
            return
        enabled, membership = seen._columns.get("enabled"), self._membership()
        entities, dead, version = membership.entities, membership.dead, membership.entities.version
        if len(seen) >= VECTORIZED_MIN:  # all at once, as long as the loop's body lets components alone
            found = seen._matching(np.arange(len(seen)), first, second, membership)
            for row, contact in zip(found.rows.tolist(), seen._records(found), strict=True):
                if entities.version != version:
                    break
                start = row + 1
                if enabled is None or enabled[row]:
                    a, b = contact.entity_a, contact.entity_b
                    if not dead or not (a in dead or b in dead):
                        yield a, b, contact
            if entities.version == version:
                return
        ids = seen.entity_a[start:].tolist(), seen.entity_b[start:].tolist()
        for row, a, b in zip(range(start, len(seen)), *ids, strict=True):
            if enabled is not None and not enabled[row]:
                continue
            of_a, of_b = membership.types_of(a), membership.types_of(b)
            forward = first in of_a and second in of_b
            if not forward and not (first in of_b and second in of_a):
                if not of_a and not of_b:
                    self._membership()  # CaromError if the loop has closed the world
            elif not dead or not (a in dead or b in dead):
                contact = seen.row(row) if forward else seen.row(row).flipped()
                yield contact.entity_a, contact.entity_b, contact

    def between(self, first: type[Any], second: type[Any]) -> ContactsBetween:
        """The contacts that :meth:`pairs` would yield for ``first`` and ``second``, as columns (k,): rows, a and b."""
        _check_types("between", first, second)
        a, b, enabled = self.entity_a, self.entity_b, self._columns.get("enabled")
        rows = np.arange(len(a)) if enabled is None else np.flatnonzero(enabled)
        if not len(rows):
            return ContactsBetween(rows, a[rows], b[rows])
        return self._matching(rows, first, second, self._membership())

    def _matching(
        self, rows: np.ndarray, first: type[Any], second: type[Any], membership: Membership
    ) -> ContactsBetween:
        """Those of the rows (n,) of an entity that has ``first`` with one that has ``second``."""
        a, b = self.entity_a, self.entity_b
        a_first, b_first = membership.mask(a[rows], first), membership.mask(b[rows], first)
        some = a_first | b_first
        rows, a_first, b_first = rows[some], a_first[some], b_first[some]
        forward = a_first & membership.mask(b[rows], second)
        some = forward | (b_first & membership.mask(a[rows], second))
        rows, forward = rows[some], forward[some]
        return ContactsBetween(rows, np.where(forward, a[rows], b[rows]), np.where(forward, b[rows], a[rows]))

    def normals_from(self, entities: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """(k, d) the normals of these ``rows`` (k,), each pointing away from that one of ``entities`` (k,)."""
        normals = self.normal[rows]
        turned = self.entity_a[rows] != entities
        return np.negative(normals, out=normals, where=turned[:, None])

    def _records(self, found: ContactsBetween) -> Iterator[Contact]:
        """Records of these rows, each seen from its a."""
        blocks = range(0, len(found.rows), BLOCK)
        parts = (ContactsBetween(*(column[at : at + BLOCK] for column in found)) for at in blocks)
        return itertools.chain.from_iterable(map(self._block, parts))

    def _block(self, found: ContactsBetween) -> list[Contact]:
        """The same of at most BLOCK rows."""
        c, rows = self._columns, found.rows
        scalars = (c[name][rows].tolist() for name in ("depth", "normal_impulse", "step"))
        times = c["time_of_impact"][rows].tolist() if "time_of_impact" in c else itertools.repeat(math.nan)
        normals = self.normals_from(found.a, rows)
        return make_contacts(len(rows), found.a.tolist(), found.b.tolist(), c["point"][rows], normals, *scalars, times)

    def of(self, entity: int) -> list[Contact]:
        """The enabled contacts of one entity, each seen from it (the normal points away from it); as in :meth:`pairs`
        none of what has been deleted."""
        c = self._columns
        rows = np.flatnonzero((c["entity_a"] == entity) | (c["entity_b"] == entity)).tolist()
        if not rows:
            return []
        here, found = self._membership(), (self.row(index) for index in rows if self._counts(index))
        living = (contact for contact in found if here.lives(contact.entity_a) and here.lives(contact.entity_b))
        return [contact if contact.entity_a == entity else contact.flipped() for contact in living]

    def _counts(self, index: int) -> bool:
        """Whether that row is a contact for queries pair by pair: a disabled one counts as not touching."""
        enabled = self._columns.get("enabled")
        return enabled is None or bool(enabled[index])


class Contacts(ContactRows):
    """The last step's contacts, with ``enabled`` that systems between NARROW and RESPONSE may clear.

    A contact is a pair that touched in the step: overlapping at the end of its motion or struck within it.

    ``begin``, ``end`` and ``impacts`` hold everything since the start of the last ``step()`` or ``advance()``; inside
    a step they hold that step's rows only, so that a system sees each event once, however many steps a frame takes.

    membership
        which living entities of the world have a component; CaromError if the world is closed
    source
        of columns and events, see :class:`~carom.systems.contacts.events.RecordedContacts`; its version changes
        whenever it has other columns to give
    """

    HISTORIES = ("begin", "end", "impacts")

    def __init__(
        self,
        dimensions: int,
        membership: Callable[[], Membership],
        running_step: Callable[[], int | None],
        source: Any,
    ) -> None:
        super().__init__(empty_columns(dimensions, enabled=True), membership)
        self._running_step = running_step  # the number of the step that is running, None between steps
        self.dimensions = dimensions
        self._source = source
        self._columns_of = self._source.version  # the version that the columns show
        self._chunks: dict[str, list[dict[str, np.ndarray]]] = {name: [] for name in self.HISTORIES}
        self.window = 0  # number of the step that the window was opened with
        self.recorded = False  # something has happened since

    # -- what users read --------------------------------------------------------------------------

    @property
    def _columns(self) -> dict[str, np.ndarray]:
        """Made when they are read; a later step does not change them."""
        if self._columns_of != self._source.version:
            self._own_columns = self._source.columns()
            self._columns_of = self._source.version
        return self._own_columns

    @property
    def manifold(self) -> ContactRows:
        """The points in which they touch, several for what lies on its face and turns: ``contact`` is the row of
        theirs, ``normal_impulse`` what each of them has given. Made when it is read, where the two are then."""
        return ContactRows(self._source.points(self._columns), self._membership)

    @property
    def begin(self) -> ContactRows:
        """Pairs that began to touch, since the start of the last ``step()`` or ``advance()``."""
        return self._history("begin")

    @property
    def end(self) -> ContactRows:
        """Pairs that ceased to touch; also when a body was deleted. Point and normal are the last known."""
        return self._history("end")

    @property
    def impacts(self) -> ContactRows:
        """One row per impact, with ``time_of_impact``; a pair may have several in a step."""
        return self._history("impacts")

    @property
    def stay(self) -> ContactRows:
        """Pairs that touched in the last step and in the one before."""
        if self._source.stay_step < self.window:
            return ContactRows(empty_columns(self.dimensions), self._membership)
        return ContactRows(self._source.stay_columns(), self._membership)

    # -- what the systems write -------------------------------------------------------------------

    def open_window(self, step: int) -> None:
        """Forget what the last window held; ``step`` is the next one's number."""
        self.window = step
        if self.recorded:
            self.recorded = False
            for chunks in self._chunks.values():
                chunks.clear()

    def enabled_now(self) -> np.ndarray | None:
        """(m,) ``enabled`` of the contacts as they are, but for those of what sleeps; None if nothing has read their
        columns, so that all are."""
        if self._columns_of != self._source.version:
            return None
        return self._source.lively(self._own_columns)

    def take_deferred(self) -> None:
        """The events are read, the next step of the window begins, or rows are about to move: record what the last step
        has brought. Most events are never read."""
        self._source.record_waiting()

    def record(self, history: str, columns: dict[str, np.ndarray]) -> None:
        """Add the rows of ``columns`` to a ``history`` of the window: begin, end or impacts."""
        if len(columns["entity_a"]):
            self.recorded = True
            self._chunks[history].append(columns)

    def forget_step(self, step: int) -> None:
        """Drop the events of a step that has failed."""
        for name, chunks in self._chunks.items():
            self._chunks[name] = [chunk for chunk in chunks if chunk["step"][0] != step]

    def columns_now(self) -> dict[str, np.ndarray]:
        """The columns (m, ...) of the contacts as they are."""
        return self._columns

    def show(self, columns: dict[str, np.ndarray]) -> None:
        """Show these columns until the source has others."""
        self._own_columns, self._columns_of = columns, self._source.version

    def saved(self) -> dict[str, Any]:
        """The events of the window, for a snapshot; the contacts too if they have been read, and so may be changed."""
        self.take_deferred()
        columns = _copied(self._own_columns) if self._columns_of == self._source.version else None
        histories = {name: [_copied(chunk) for chunk in chunks] for name, chunks in self._chunks.items()}
        return {"window": self.window, "columns": columns, "histories": histories}

    def take_back(self, saved: dict[str, Any]) -> None:
        """Show what was ``saved`` again; the source has the contacts of that time."""
        self.recorded, self.window = True, saved["window"]
        self._chunks = {name: [_copied(chunk) for chunk in chunks] for name, chunks in saved["histories"].items()}
        if saved["columns"] is not None:
            self.show(_copied(saved["columns"]))

    def _history(self, name: str) -> ContactRows:
        self.take_deferred()
        chunks, step = self._chunks[name], self._running_step()
        if step is not None:
            chunks = [chunk for chunk in chunks if chunk["step"][0] == step]
        if not chunks:
            return ContactRows(empty_columns(self.dimensions, impact=name == "impacts"), self._membership)
        if len(chunks) > 1:
            joined = {key: np.concatenate([chunk[key] for chunk in chunks]) for key in chunks[0]}
            if step is not None:
                return ContactRows(joined, self._membership)
            chunks[:] = [joined]
        return ContactRows(chunks[0], self._membership)


def _copied(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: column.copy() for name, column in columns.items()}


def empty_columns(dimensions: int, enabled: bool = False, impact: bool = False) -> dict[str, np.ndarray]:
    """Columns of no contacts."""
    columns: dict[str, np.ndarray] = {
        "entity_a": np.empty(0, np.int64),
        "entity_b": np.empty(0, np.int64),
        "point": np.empty((0, dimensions)),
        "normal": np.empty((0, dimensions)),
        "depth": np.empty(0),
        "normal_impulse": np.empty(0),
        "step": np.empty(0, np.int64),
    }
    if enabled:
        columns["enabled"] = np.empty(0, bool)
    if impact:
        columns["time_of_impact"] = np.empty(0)
    return columns
