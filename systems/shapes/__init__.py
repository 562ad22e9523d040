"""Shapes: what the compiled stages of a step know of colliders, whatever shapes a scene has.

A shape has a number, its place among the scene's shapes, cheapest first. Its functions (those of plugins) are small
linked functions, compiled once per shape or pair and called through tables of addresses in the record ``state.shapes``:

- per pair (i, j), i <= j: ``evaluate`` for one pair of bodies, ``batch`` for a run of candidates, ``sweep`` and
  ``corner`` where a plugin declares them;
- per shape: ``bounds``, ``rotated``, and ``support`` and ``rounding`` for pairs that are compiled once for all convex
  shapes.

Kernels import :mod:`dispatch` and :mod:`query`, which take numbers of shapes. Python makes
:mod:`linking.linked_shapes`, which fills the tables, and wraps calls of kernels in :mod:`attribution`, which names the
plugin when its function fails.

Modules, each using those before it: convex/ (the geometry of any two convex shapes), linking/ (the functions and
tables), dispatch, query, attribution.

Reads the columns of colliders, positions and offsets; writes hit, depth, normal and point of candidates, the trace
(``row_a`` to ``unsound_b`` of the state) and the shapes' parameters as rotated.
"""
