"""The turns of a plane's bodies, ascending by entity id."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...components.spin import Spin
from ...framework import World

Floats = NDArray[np.float64]


def inertia_by_id(world: World) -> Floats:
    """Moments of inertia (n,) of the dynamic bodies; infinite for what does not spin."""
    dynamic = world.bodies.dynamic
    inertia = np.full(len(dynamic), np.inf)
    for k in np.flatnonzero(dynamic.has(Spin)).tolist():
        inertia[k] = world.component_for_entity(int(dynamic.entity[k]), Spin).moments
    return inertia[np.argsort(dynamic.entity, kind="stable")]


def turns_by_id(world: World) -> tuple[Floats, Floats]:
    """The angles and angular velocities (m,) of the dynamic bodies, then of the kinematic ones."""
    bodies, order = world.bodies, moving_rows(world)
    spins = bodies.spin.angular_velocity if bodies.has(Spin).any() else np.zeros(len(bodies))
    return np.array(bodies.rotation)[order], np.array(spins)[order]


def moving_rows(world: World) -> NDArray[np.int64]:
    """Of the dynamic bodies, then of the kinematic ones."""
    dynamic, kinematic = world.bodies.dynamic, world.bodies.kinematic
    some = [bodies.rows.start + np.argsort(bodies.entity, kind="stable") for bodies in (dynamic, kinematic)]
    return np.concatenate(some)
