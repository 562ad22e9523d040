"""The rows of a body of several parts. In a world without any, each body has one row."""

from __future__ import annotations

from ...framework.compilation import inlined


@inlined
def owner_of(state, i):
    """The row of the body that row i belongs to."""
    return state.bodies.owner[i] if state.has_parts else i


@inlined
def next_row(state, k):
    """The row of the same body that follows; -1 behind the last one. The first one is that of the body."""
    return state.bodies.next_part[k] if state.has_parts else -1


@inlined
def has_parts(state, i):
    """Whether row i is a body of several parts."""
    return state.has_parts and state.bodies.owner[i] == i and state.bodies.next_part[i] >= 0


@inlined
def place_of(state, i):
    """Where the solver has the body of row i."""
    return state.bodies.place[owner_of(state, i)]
