"""Stages: the compiled pieces of a step, and the program that runs them one after the other in a single call.

The list of stages is the only description of what a step does: ``world.plan()``, ``stats()``, ``profile()`` and
docs/architecture.md all read it, and it is checked that a failed step puts back what they write.
"""

from __future__ import annotations

import dis
import functools
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..compilation import entry_point, inlined, log, packed, untimed_kernel
from ..jit.hash import is_packed
from ..jit.kinds import FLOAT, INT, record_kind
from ..jit.linkable import Linkable
from ..jit.linking import Linked, linked_call
from ..jit.records.record import Record
from ..jit.records.record_type import record_at
from ..jit.records.schema import Schema, integer, ints
from ..jit.source import source_module
from ..jit.tick_counter import TickClock, read_ticks, ticks_now

# What every state begins with: addresses of the stages (0: not needed; below 0: its time counts with that of the next),
# the time that each has taken in ticks of the processor's clock, how often it ran, and the one that runs now.
PROGRAM_FIELDS: dict[str, Any] = {"program": ints(), "ticks": ints(), "calls": ints(), "stage": integer()}
PROGRAM = Schema("Program", **PROGRAM_FIELDS)

_program_at = record_at(PROGRAM, 2)
_call_stage = linked_call(lambda: INT(record_kind(PROGRAM, 2), FLOAT))


@untimed_kernel
def run_stages(address: int, start: int, stop: int, dt: float) -> int:
    """Run the stages start..stop-1 of the program of the state at that address.

    Returns 0, or the code of the stage that cannot go on by itself, which is in ``state.stage``.
    """
    state = _program_at(address)
    program, ticks, calls = state.program, state.ticks, state.calls
    before = read_ticks()
    for k in range(start, stop):
        address = program[k]
        if address != 0:
            state.stage = k
            code = _call_stage(abs(address), state, dt)
            calls[k] += 1
            if address > 0 or code != 0 or k == stop - 1:  # it takes longer than a stage that has nothing to do
                now = read_ticks()
                ticks[k] += now - before
                before = now
            if code != 0:
                return code
    return 0


NEED_ROOM = 1  # what a stage returns that needs more rows than the columns of its ``room`` have


def asked(state):
    """So many rows as a stage finds out within that it needs: it writes ``needed`` and returns NEED_ROOM."""
    return state.needed


@dataclass(frozen=True, eq=False)
class Rows:
    """Columns of a record of the state, ``"solver"``, that a stage writes, and how many rows they need.

    columns
        those that grow together, but for columns of the bodies, of which each may have its rows already
    count
        of the state, to be compiled: so many rows. The stage runs only with as many; :func:`asked` is for those that
        find out within
    """

    record: str
    columns: Iterable[str]
    count: Callable[[Any], int]

    @property
    def telling(self) -> tuple[str, ...]:
        """The columns that tell whether there are enough rows."""
        columns = tuple(self.columns)
        return columns if self.record == "bodies" else columns[:1]


@dataclass(frozen=True)
class Stage:
    """A compiled function ``(state, dt) -> code`` without knowledge of shapes.

    reads, writes
        columns and records; writing a column of the table means that a failed step has to put it back
    why
        what it does, for ``world.plan()``
    needed
        name of the property of the scene that has to be true; empty: always
    when
        what has to happen for it to do something; empty: in every step
    room
        what grows with what: it runs only where these columns have so many rows, and else returns NEED_ROOM
    anchor, plugin
        of a plugin's stage: the built-in one next to which it runs, and the name of the plugin
    """

    function: Callable[..., int]
    why: str
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    needed: str = ""
    when: str = ""
    room: tuple[Rows, ...] = ()
    anchor: str = ""
    plugin: str = ""

    def __post_init__(self) -> None:
        if False in answers(self.function):
            raise ValueError(f"stage {self.name} must return a code on every path: 0, or what it asks of Python")

    @property
    def name(self) -> str:
        return self.function.__name__

    @functools.cached_property
    def tested(self) -> tuple[Rows, ...]:
        """What of its room is tested before it runs."""
        return tuple(rows for rows in self.room if rows.count is not asked)


@functools.cache  # reading the code takes long, and each world makes stages of it
def answers(function: Callable[..., Any]) -> set[bool]:
    """Of the paths through a function: True if one returns something, False if one ends without, or returns None."""
    found, before = set(), None
    for instruction in dis.get_instructions(function):
        value: Any = {"RETURN_CONST": instruction, "RETURN_VALUE": before}.get(instruction.opname)
        if value is not None:
            found.add(value.opname not in ("RETURN_CONST", "LOAD_CONST") or value.argval is not None)
        before = instruction
    return found


class Program:
    """The stages of one world, in order, with the time they take.

    handlers
        by code: called with dt when a stage returns it. Below ``afterwards`` the stage then runs again, from there on
        the next one follows
    """

    def __init__(
        self, state: Record, stages: Sequence[Stage], handlers: dict[int, Callable[[float], None]], afterwards: int
    ) -> None:
        self.state, self._address = state, state.address
        self.handlers, self._afterwards = handlers, afterwards
        self._words, self._stage = state.words, state.word_of("stage")
        self._clock: TickClock | None = None  # from the first link on
        self.stages: tuple[Stage, ...] = ()
        self._python_seconds = np.zeros(0)  # of what Python has done for each stage
        self.take(stages)
        self.inside = 0.0  # s of stages that Python has run within a step: not to be counted twice
        self.system_of: Callable[[int], Any] = lambda stage: stage  # the system of a stage
        self._apart = False
        self.describe_error: Callable[[BaseException], None] = lambda error: None  # adds notes to it
        self.alarm = 0  # the word of the state that is not 0 when a stage has noted something wrong
        self.on_alarm: Callable[[], None] = lambda: None

    def take(self, stages: Sequence[Stage]) -> None:
        """Run these from now on, once they are linked; those that it has had go on counting."""
        state, before = self.state, dict(zip((stage.name for stage in self.stages), self.counts().T, strict=True))
        self.stages = tuple(stages)
        self.index = {stage.name: k for k, stage in enumerate(self.stages)}
        self.spans: dict[str, tuple[int, int]] = {}  # of each built-in stage with those of plugins next to it
        for k, stage in enumerate(self.stages):
            home = stage.anchor or stage.name
            self.spans[home] = self.spans.get(home, (k, k))[0], k + 1
        counts = np.array([before.get(stage.name, np.zeros(3)) for stage in self.stages]).reshape(-1, 3)
        self._addresses = np.zeros(len(stages), np.int64)
        state.program = self._addresses
        state.calls, state.ticks = (np.ascontiguousarray(counts[:, k]).astype(np.int64) for k in (0, 1))
        self._python_seconds = counts[:, 2].copy()

    @functools.cached_property
    def _run_stages(self) -> Any:
        return entry_point(run_stages)

    def functions(self, wanted: Callable[[Stage], bool]) -> Iterator[Linkable]:
        """What :meth:`link` and :meth:`run` call."""
        yield from (run_stages, ticks_now)
        yield from (self._linked(stage) for stage in self.stages if wanted(stage))

    def link(self, wanted: Callable[[Stage], bool]) -> None:
        """Compile or load the stages that are wanted; the others are skipped from now on."""
        self._clock = self._clock or TickClock()
        for k, stage in enumerate(self.stages):
            self._addresses[k] = self._linked(stage).address if wanted(stage) else 0
        self.time_apart(self._apart)

    def time_apart(self, on: bool) -> None:
        """Whether each stage is timed by itself: else those of a system are together."""
        self._apart, after, addresses = on, None, self._addresses
        for k in reversed(np.flatnonzero(addresses).tolist()):
            system = self.system_of(k)
            addresses[k] = abs(addresses[k]) * (-1 if system == after and not on else 1)
            after = system

    def _linked(self, stage: Stage) -> Linked:
        return linked_stage(stage, self.state.schema, self.state.dimensions)

    def is_linked(self, name: str) -> bool:
        """Whether that stage runs."""
        return self._addresses[self.index[name]] != 0

    def run(self, start: int, stop: int, dt: float) -> None:
        """Run the stages start..stop-1, and what Python has to do in between."""
        self.resume(self.call(start, stop, dt), stop, dt)

    def call(self, start: int, stop: int, dt: float) -> int:
        """Run the stages start..stop-1 up to one that asks for something; its code, 0 if none does."""
        try:
            return self._run_stages(self._address, start, stop, dt)
        except Exception as error:
            stage = self.stages[self._words[self._stage]]
            if stage.plugin:
                blamed, self.state.blamed = int(self.state.blamed), 0
                entity = f", entity {self.state.bodies.entity[blamed - 1]}" if blamed else ""
                error.add_note(f"plugin {stage.plugin}: stage {stage.name}{entity}")
            else:
                self.describe_error(error)
            raise

    def resume(self, code: int, stop: int, dt: float) -> None:
        """Do what a stage has asked for by that code, and run those that follow it."""
        while code:
            start = self._words[self._stage]
            self._handle(start, code, dt)
            if code >= self._afterwards:
                start += 1
            code = self.call(start, stop, dt) if start < stop else 0
        if self._words[self.alarm]:
            self.on_alarm()

    def _handle(self, stage: int, code: int, dt: float) -> None:
        """What a stage asks of Python, which counts as time of that stage."""
        if code not in self.handlers:
            known = ", ".join(map(str, sorted(self.handlers)))
            raise ValueError(
                f"stage {self.stages[stage].name} returned {code}, which is no code of a stage: these are {known}, and "
                f"0 for what is done"
            )
        inside, waited, began = self.inside, log.waited, time.perf_counter()
        self.handlers[code](dt)
        passed = time.perf_counter() - began - (log.waited - waited)
        self._python_seconds[stage] += max(passed - (self.inside - inside), 0.0)

    def run_inside(self, start: int, stop: int, dt: float) -> None:
        """The same as :meth:`run`, for Python code that is a part of a step itself."""
        inside, waited, began = self.inside, log.waited, time.perf_counter()
        self.run(start, stop, dt)
        self.inside = inside + time.perf_counter() - began - (log.waited - waited)

    def run_one(self, name: str, dt: float) -> None:
        """Run one stage, linked or not."""
        k = self._required(name)
        self.run_inside(k, k + 1, dt)

    def run_span(self, name: str, dt: float) -> None:
        """The same, with the stages of plugins next to it that are linked."""
        self._required(name)
        self.run_inside(*self.spans[name], dt)

    def _required(self, name: str) -> int:
        k = self.index[name]
        if not self._addresses[k]:
            self._addresses[k] = self._linked(self.stages[k]).address
        return k

    def segment(self, first: str, last: str) -> Segment:
        """The stages from one built-in stage to another, with those of plugins next to these."""
        return Segment(self, self.spans[first][0], self.spans[last][1])

    def counts(self) -> np.ndarray:
        """(3, n): how often each stage has run so far, its ticks, and the seconds that Python has worked for it."""
        return np.stack((self.state.calls, self.state.ticks, self._python_seconds))

    def seconds_of(self, counts: np.ndarray) -> np.ndarray:
        """The seconds of each stage, from a difference of :meth:`counts`."""
        return counts[1] * (self._clock.seconds_per_tick if self._clock else 0.0) + counts[2]


_linked: dict[tuple[Any, Any], Linked] = {}


def linked_stage(stage: Stage, schema: Schema, dimensions: int) -> Linked:
    """The stage's compiled function for states of that kind, one for the process."""
    kind = record_kind(schema, dimensions)
    key = (stage.function, stage.tested, kind)
    if key not in _linked:
        _linked[key] = Linked(_with_room(stage), INT(kind, FLOAT), f"stage {stage.name}, {dimensions}D,")
    return _linked[key]


def _with_room(stage: Stage) -> Callable[..., int]:
    """The stage's function behind a test of its room."""
    if not stage.tested:
        return stage.function
    counts = (getattr(rows.count, "py_func", rows.count) for rows in stage.tested)
    scope: dict[str, Any] = {f"rows_{k}": inlined(count) for k, count in enumerate(counts)}
    short = (
        f"rows_{k}(state) > len(state.{rows.record}.{name})"
        for k, rows in enumerate(stage.tested) for name in rows.telling
    )  # fmt: skip
    lines = (
        f"def {stage.name}(state, dt):", f"    if {' or '.join(short)}:", "        return NEED_ROOM",
        "    return function(state, dt)", "",
    )  # fmt: skip
    scope |= {"function": inlined(stage.function), "NEED_ROOM": NEED_ROOM}
    made = getattr(source_module("\n".join(lines), scope), stage.name)
    return packed(made) if is_packed(stage.function) else made


@dataclass(frozen=True)
class Segment:
    """Some neighbouring stages of a program: one call from Python, whatever their number."""

    program: Program
    start: int
    stop: int

    def __call__(self, dt: float) -> None:
        self.program.run_inside(self.start, self.stop, dt)


@dataclass(frozen=True)
class PythonPart:
    """A part of a step that is plain Python, with the name of the system it belongs to."""

    name: str
    function: Callable[[float], None]

    def __call__(self, dt: float) -> None:
        self.function(dt)


@dataclass(frozen=True)
class Check:
    """A Python part that runs only if a word of a record is not 0."""

    words: memoryview
    index: int
    part: PythonPart

    def __call__(self, dt: float) -> None:
        if self.words[self.index]:
            self.part(dt)


def merged(parts: Sequence[Any]) -> list[Any]:
    """The same parts with neighbouring segments of one program joined."""
    result: list[Any] = []
    for part in parts:
        last = result[-1] if result else None
        both = isinstance(part, Segment) and isinstance(last, Segment)
        if both and last.program is part.program and last.stop == part.start:
            result[-1] = Segment(part.program, last.start, part.stop)
        else:
            result.append(part)
    return result
