"""The whole step in plain Python, for small scenes; the compiled systems must agree with it.

``Oracle(world)`` is a copy of the world's present bodies; take a new one when bodies come or go. It computes forces,
motion, sweeps, impacts and contacts at rest. It raises ValueError for force systems, user systems and plugin shapes.

Where rounding decides the result, both may be right: ``oracle.doubts`` lists these pairs of the last step. For rigid
contacts ``oracle.slack`` (m/s, by body) and ``oracle.impulse_slack`` (N s, by pair) say how far the two may differ;
``assert_agrees`` allows that.
"""

from __future__ import annotations

from .step import Oracle, OracleContact, assert_agrees

__all__ = ["Oracle", "OracleContact", "assert_agrees"]
