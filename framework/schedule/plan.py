"""``world.plan()``: what runs in a step, in order, with which kernels, on which columns, and why."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from .phases import System

NO_SYSTEM = "no system"
WIDTH = 120  # of the printed lines


@dataclass(frozen=True)
class PlannedKernel:
    """A compiled loop that a system calls, by the name that ``world.profile()`` shows.

    kernel, reason
        its name, and what it is for
    when
        what has to happen for it to be called, and so to be compiled; empty: in every step
    reads, writes
        the columns of a stage
    """

    kernel: str
    reason: str
    when: str = ""
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()


def kernels_of(segment: Any) -> Iterator[PlannedKernel]:
    """The stages of a segment that are needed in this scene."""
    for stage in segment.program.stages[segment.start : segment.stop]:
        if segment.program.is_linked(stage.name):
            yield PlannedKernel(stage.name, stage.why, stage.when, stage.reads, stage.writes)


@dataclass(frozen=True)
class PlannedColumn:
    """An array with a value for each body (or pair, contact, impact) there is room for.

    column
        as in ``world.bodies`` where it is the field of a component
    of
        "body", "pair", "contact" or "impact"
    group
        the component whose field it is, or what uses it
    bytes
        for one of them
    unit
        "m", "N s"; "1" of a ratio; empty of counts, flags and what has several units
    """

    column: str
    of: str
    group: str
    bytes: int
    reason: str
    unit: str = ""

    @property
    def name(self) -> str:
        """Without the component's prefix."""
        return self.column.rpartition(".")[2] if "." in self.column.rstrip(".") else self.column


@dataclass(frozen=True)
class PlanEntry:
    """One system of a step: its phase, its esper priority, what it has to do in this world, and its kernels."""

    phase: str
    system: str
    priority: int
    reason: str
    kernels: tuple[PlannedKernel, ...] = ()


@dataclass(frozen=True)
class Plan:
    """Printable.

    entries
        in the order of a step
    around
        kernels that no system calls: at the start and at the end of a step
    columns
        all arrays there are of bodies, pairs, contacts and impacts
    """

    entries: tuple[PlanEntry, ...]
    around: tuple[PlannedKernel, ...] = ()
    columns: tuple[PlannedColumn, ...] = ()

    @classmethod
    def of(cls, systems: Sequence[System], physics: Any) -> Plan:
        """Of a world's ``systems`` and ``physics`` now."""
        entries = [
            PlanEntry(
                s.phase.name,
                s.name,
                s.priority,
                getattr(s, "reason", lambda: "added by the game")(),
                tuple(getattr(s, "kernels", tuple)()),
            )
            for s in systems
        ]
        return cls(tuple(entries), tuple(physics.planned_kernels()), tuple(physics.planned_columns()))

    @property
    def kernels(self) -> tuple[PlannedKernel, ...]:
        """Those of all systems in their order, then those around the step."""
        return *(kernel for entry in self.entries for kernel in entry.kernels), *self.around

    def __str__(self) -> str:
        rows = [row for entry in self.entries for row in _system_rows(entry)]
        if self.around:
            rows += [(NO_SYSTEM, "", "", "at the start and the end of the step"), *_kernel_rows(self.around)]
        wide = max((len(name) for _, _, name, _ in rows), default=0)
        lines = [f"{phase:<12}{priority:>5}  {name:<{wide}}  {what}".rstrip() for phase, priority, name, what in rows]
        return "\n".join((*lines, *self._column_lines()))

    def _column_lines(self) -> Iterator[str]:
        """A line for each group of columns that are there for the same reason."""
        groups: dict[tuple[str, str, str], list[PlannedColumn]] = {}
        for column in self.columns:
            groups.setdefault((column.of, column.group, column.reason), []).append(column)
        of = ""
        kinds = list(dict.fromkeys(key[0] for key in groups))
        for key, columns in sorted(groups.items(), key=lambda group: kinds.index(group[0][0])):
            if key[0] != of:
                of = key[0]
                total = sum(column.bytes for column in self.columns if column.of == of)
                yield ""
                yield f"{f'columns, bytes per {of}':<28}{total:>4}"
            size = sum(column.bytes for column in columns)
            names = ", ".join(f"{c.name} [{c.unit}]" if c.unit not in ("", "1") else c.name for c in columns)
            yield from textwrap.wrap(
                f"{names}: {key[2]}", WIDTH, initial_indent=f"  {key[1]:<26}{size:>4}  ", subsequent_indent=" " * 34
            )


def _system_rows(entry: PlanEntry) -> Iterator[tuple[str, str, str, str]]:
    yield entry.phase, str(entry.priority), entry.system, entry.reason
    yield from _kernel_rows(entry.kernels)


def _kernel_rows(kernels: tuple[PlannedKernel, ...]) -> Iterator[tuple[str, str, str, str]]:
    for kernel in kernels:
        yield "", "", f"  {kernel.kernel}", kernel.reason + (f" (when {kernel.when})" if kernel.when else "")
