"""Convex shapes whose support is called by address: for functions that are compiled once for all of them."""

from __future__ import annotations

from ....framework.compilation import inlined
from ....framework.jit.records.record_type import record_at
from .parameters import HEADER
from .signatures import call_edge, call_rounding, call_support
from .user_functions import as_argument

# The header has no vectors, so it is the same in 2D and 3D.
_header_at = record_at(HEADER, 2)


@inlined
def convex_at(address, i):
    """Row i of the parameter record at an address, as the two functions below take it: addresses and row."""
    header = _header_at(address)
    return header.support, header.rounding, address, i


@inlined
def support_by_address(shape, direction):
    """The farthest point of the core in a direction."""
    return call_support(shape[0], shape[2], shape[3], direction)


@inlined
def rounding_by_address(shape):
    """How far the shape reaches beyond its core."""
    return call_rounding(shape[1], shape[2], shape[3]) if shape[1] != 0 else 0.0


@inlined
def tells_edge(shape):
    """Whether the record has the address of its edges."""
    return _header_at(shape[2]).edge != 0


@inlined
def edge_by_address(shape, normal, point, tilt):
    """In a plane both ends, counter-clockwise, of the core's edge in the direction of a normal: the one that looks most
    that way, if the shape tells it, else as in :func:`~..convex.edges.edge_towards`; without a support at a point."""
    x0, y0, x1, y1 = call_edge(_header_at(shape[2]).edge, shape[2], shape[3], normal, point, tilt)
    return (x0, y0), (x1, y1)


support_argument, rounding_argument = as_argument(support_by_address), as_argument(rounding_by_address)
