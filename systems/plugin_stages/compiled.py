"""Stages of plugins as the program calls them, and the records that they get."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ...framework.data.arrays.column import ArrayColumn
from ...framework.data.columns import Column
from ...framework.data.component import Component
from ...framework.jit.linking import CACHE_SIZE
from ...framework.jit.records import schema
from ...framework.jit.records.record_type import record_at
from ...framework.jit.records.schema import Schema
from ...framework.jit.source import source_module
from ...framework.plugins.checks import is_column, plain_function
from ...framework.plugins.registry import PluginStage
from ...framework.schedule.stages import answers
from ..codes import NEED_ROOM, OK
from ..shapes.linking.user_functions import user_function

PRESENT = "present"  # the column that says which rows have the component


def visible_columns(component: type[Component]) -> list[Column]:
    """Those that a record of the component has: arrays are for shapes alone, and some columns for the state."""
    hidden = getattr(component, "hidden_columns", ())
    columns = component.columns.values()
    return [column for column in columns if not (isinstance(column, ArrayColumn) or column.name in hidden)]


@lru_cache(maxsize=CACHE_SIZE)
def component_schema(component: type[Component], dimensions: int) -> Schema:
    """The record of a component's columns; a quaternion is four numbers, read and written one by one, what turns is one
    or three."""
    fields: dict[str, Any] = {PRESENT: schema.flags()}
    for column in visible_columns(component):
        if column.item == "vector":
            fields[column.name] = schema.vectors()
        elif column.item == "angular":
            fields[column.name] = schema.table("float64", 1 if dimensions == 2 else 3)
        elif column.item_shape(dimensions):
            fields[column.name] = schema.table("float64", 4)
        else:
            fields[column.name] = schema.Column(np.dtype(column.dtype).name)
    return Schema(component.__name__, **fields)


@lru_cache(maxsize=CACHE_SIZE)
def own_schema(stage: PluginStage, dimensions: int) -> Schema:
    """The record of all that a stage gets beside the state, by number."""
    schemas = (each if isinstance(each, Schema) else component_schema(each, dimensions) for each in stage.records)
    return Schema("Own", **{f"record_{k}": each for k, each in enumerate(schemas)})


def own_columns(stage: PluginStage) -> list[tuple[str, str]]:
    """The columns of records of the plugin's own, as fields of the record of all."""
    own = [(f"record_{k}", each) for k, each in enumerate(stage.records) if isinstance(each, Schema)]
    return [(record, name) for record, each in own for name, field in each.fields.items() if is_column(field)]


@lru_cache(maxsize=CACHE_SIZE)
def compiled_stage(stage: PluginStage, dimensions: int) -> Any:
    """A function (state, dt) -> code of the plugin's function; it has its name."""
    scope = {"function": user_function(stage.function), "OK": OK}
    lines = [f"def {stage.name}(state, dt):"]
    names = [f"own.{name}" for name in own_schema(stage, dimensions).fields]
    if names:
        scope["own_at"] = record_at(own_schema(stage, dimensions), dimensions)
        lines.append("    own = own_at(state.plugin_stages[state.stage])")
    call = f"function({', '.join(('state', 'dt', *names))})"
    if True in answers(plain_function(stage.function)):
        short = " or ".join(f"state.needed > len(own.{record}.{name})" for record, name in own_columns(stage))
        scope["NEED_ROOM"] = NEED_ROOM
        lines += [f"    state.needed = {call}", f"    if {short}:", "        return NEED_ROOM"]
    else:
        lines.append(f"    {call}")
    lines += ["    return OK", ""]
    return getattr(source_module("\n".join(lines), scope), stage.name)
