"""Imported by the process that others are forked from: numba's tables of types."""

from numba.core.registry import cpu_target

cpu_target.typing_context.refresh()
