"""Where stages of plugins run: checked when a world gets them, then put between the built-in ones."""

from __future__ import annotations

import types
from collections.abc import Iterable, Iterator
from typing import Any

from ...framework.errors import PluginError
from ...framework.jit.records.schema import Schema
from ...framework.names import did_you_mean
from ...framework.plugins.registry import PluginStage
from ...framework.schedule.stages import Rows, Stage, asked
from ..broad_phase.system import BroadPhase
from ..integration.system import ON_WAY, Integration
from ..narrow_phase.system import NarrowPhase
from ..records import (
    BODIES,
    COLLIDERS,
    HELD_COLUMNS,
    QUARANTINE,
    SLEEP_COLUMNS,
    STATE,
    TABLE_COLUMNS,
    UNDO_COLUMNS,
    UNDO_FORCE,
    UNDO_HOLD,
)
from ..stage_list import CONDITIONS, ON_DEMAND, STAGES, SYSTEM_OF_STAGE
from .compiled import compiled_stage, own_columns, visible_columns

INTEGRATORS = {stage.name for stage in Integration.STAGES if stage.needed in ("standard", stage.name)}
REPEATED = (BroadPhase.__name__, NarrowPhase.__name__)  # their stages may run several times in a step
RECORDS = {name for name, field in STATE.fields.items() if isinstance(field, Schema)} - {"bodies", "colliders"}
# What others rely on in ways that no stage of a plugin can keep to, or what no failed step would put back.
UNDONE = (*SLEEP_COLUMNS, *QUARANTINE, *UNDO_COLUMNS, *UNDO_FORCE, *UNDO_HOLD, *HELD_COLUMNS)
FIXED = {"entity", "shape", "rank", "collider_slot", *UNDONE, *COLLIDERS.fields}
FIXED -= {"rest_steps"}  # of what is not at rest, whatever its velocity says
OF_TABLE = {*TABLE_COLUMNS, "rotation"} - {"entity"}
FIRST_AND_LAST = "the first place is before='check_columns', the last before='close_step'"
CHOICES = tuple(name for name in CONDITIONS if name not in ("standard", "stages of plugins", "on demand"))


def placed(stages: Iterable[PluginStage], dimensions: int) -> Iterator[Stage]:
    """All stages of a step in their order: at each place those of plugins in the order in which they are given."""
    own = [(stage, made(stage, dimensions)) for stage in stages]
    for built_in in STAGES:
        here = [(stage.after, one) for stage, one in own if stage.anchor == built_in.name]
        yield from (one for after, one in here if not after)
        yield built_in
        yield from (one for after, one in here if after)


def made(stage: PluginStage, dimensions: int) -> Stage:
    """The stage as programs have it; the one condition that it is needed for goes by its own name."""
    why = f"plugin {stage.plugin}" + (f": {stage.why}" if stage.why else "")
    function = compiled_stage(stage, dimensions)
    room = tuple(Rows(record, (name,), asked) for record, name in own_columns(stage))
    return Stage(
        function, why, stage.reads, stage.writes, stage.name, room=room, anchor=stage.anchor, plugin=stage.plugin
    )


def check_plugin_stages(stages: Iterable[PluginStage]) -> None:
    """PluginError for a stage that no step can have."""
    for stage in stages:
        fault = _fault_of_place(stage) or _fault_of_columns(stage)
        if not fault and stage.needed not in CHOICES and not is_on_way(stage):
            fault = f"needed must be one of {', '.join(CHOICES)}, got {stage.needed!r}"
        if fault:
            raise PluginError(f"plugin {stage.plugin}: stage {stage.name}, {stage.place}: {fault}")


def is_on_way(stage: PluginStage) -> bool:
    """Whether it turns bodies within the step, beside the stages of integrators."""
    return stage.anchor == ON_WAY and stage.needed == "on demand"


def _fault_of_place(stage: PluginStage) -> str:
    anchor = stage.anchor
    if stage.name in SYSTEM_OF_STAGE:
        return "a built-in stage has that name"
    if anchor not in SYSTEM_OF_STAGE:
        return f"there is no such stage{did_you_mean(anchor, SYSTEM_OF_STAGE)}; docs/architecture.md lists them"
    if anchor in {each.name for each in ON_DEMAND} and not is_on_way(stage):
        return "that stage is no part of every step"
    if anchor in INTEGRATORS:
        return "that stage belongs to some integrators: before='end_flight' is after the flight of all"
    if anchor in ("keep_state", "keep_written") or (anchor == "close_step" and stage.after):
        return f"what runs there is not undone if the step fails: {FIRST_AND_LAST}"
    return ""


def _fault_of_columns(stage: PluginStage) -> str:
    own = {column.key: component for component in stage.components for column in visible_columns(component)}
    known = {*BODIES.fields, *COLLIDERS.fields, *RECORDS, *own}
    for name in (*stage.reads, *stage.writes):
        if name not in known:
            return f"no record has {name!r}{did_you_mean(name, known)}"
    for name in stage.writes:
        if name in FIXED or hasattr(own.get(name), "stack"):  # of a shape
            return f"it writes {name}, which is for reading only"
        if (name in BODIES.fields or name in own) and SYSTEM_OF_STAGE[stage.anchor] in REPEATED:
            return (
                f"it writes {name}, and stages of {' and '.join(REPEATED)} may run several times in a step: they must "
                f"not change the bodies"
            )
    if "tree" in stage.reads and SYSTEM_OF_STAGE[stage.anchor]:
        return "it reads tree, and queries know where the bodies are only in stages before='update_sleep' or later"
    named = {name.rpartition(".")[2] for name in (*stage.reads, *stage.writes)}
    used = _names_in(stage.function, set()) & {name.rpartition(".")[2] for name in known}
    unnamed = sorted(used - named - {name for schema in stage.schemas for name in schema.fields})
    if unnamed:
        what = "them" if len(unnamed) > 1 else "it"
        return f"it uses {', '.join(unnamed)}, and names {what} neither in reads nor in writes"
    return ""


def _names_in(function: Any, seen: set[Any]) -> set[str]:
    """The attributes that a function names, and the functions that it calls, but for carom's own."""
    function = getattr(function, "py_func", function)
    if not isinstance(function, types.FunctionType) or function in seen or function.__module__.startswith("carom."):
        return set()
    seen.add(function)
    found = set(function.__code__.co_names)
    for value in (*(function.__globals__.get(name) for name in found), *(function.__closure__ or ())):
        found |= _names_in(getattr(value, "cell_contents", value), seen)
    return found
