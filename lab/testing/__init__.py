"""``carom.lab.testing``: the kit for system-level tests of games. docs/testing.md shows how to use it.

Worlds: make_world, ball, box, floor, create_in_order; run, run_until; position, velocity.
Predictions in closed form: free_flight, flight_after, fall_time, bounce_heights, collide, sliding_distance and others.
Assertions: Conserved, ContactLog and the functions whose names begin with assert. They raise AssertionError and need
no test framework.
"""

from __future__ import annotations

from .checks import (
    Conserved,
    ContactLog,
    assert_apart,
    assert_at_rest,
    assert_frame_rate_free,
    assert_inside,
    assert_no_overlap,
    assert_position,
    assert_same_bits,
    assert_touching,
    assert_velocity,
    energy,
    touching,
)
from .predict import (
    bounce_heights,
    bounce_times,
    collide,
    damped_velocity,
    fall_speed,
    fall_time,
    flight_after,
    free_flight,
    impact_time,
    orbit_speed,
    sliding_distance,
    sliding_time,
    spring,
)
from .worlds import ball, box, create_in_order, floor, make_world, position, run, run_until, velocity

__all__ = [
    "Conserved", "ContactLog", "assert_apart", "assert_at_rest", "assert_frame_rate_free", "assert_inside",
    "assert_no_overlap", "assert_position", "assert_same_bits", "assert_touching", "assert_velocity", "ball",
    "bounce_heights", "bounce_times", "box", "collide", "create_in_order", "damped_velocity", "energy",
    "fall_speed", "fall_time", "flight_after", "floor", "free_flight", "impact_time", "make_world", "orbit_speed",
    "position", "run", "run_until", "sliding_distance", "sliding_time", "spring", "touching", "velocity",
]  # fmt: skip
