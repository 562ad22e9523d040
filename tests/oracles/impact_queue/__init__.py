"""Flights and impacts of one step in plain Python, for small scenes in which nothing rests.

``Oracle(world)`` copies the world's present bodies; ``step()`` moves them by a step: free flight, then impacts in order
of time, each pair tested along its whole path and again after each impact of one of its bodies. It knows spheres and
boxes, gravity, constant forces and damping, Euler, Verlet and event-driven flight, restitution, friction and sensors.
No contacts at rest, no limit on impacts. The compiled step must agree with it.
"""

from __future__ import annotations

from .step import Oracle, assert_agrees

__all__ = ["Oracle", "assert_agrees"]
