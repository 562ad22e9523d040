"""The settings of a world: checked against what its plugins have, and written into the state."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..framework.jit.records.record import Record
from ..framework.names import did_you_mean
from ..framework.plugins.registry import Registry
from ..framework.settings import AUTOMATIC, MIXING_RULES, Settings
from .ccd.search_bounds import MODES
from .shapes.linking.mixing import rule_number


def check_settings(settings: Settings, registry: Registry) -> None:
    """ValueError if the settings name something that no plugin has."""
    for name, known in (
        ("integrator", registry.integrators),
        ("restitution_mixing", (*MIXING_RULES, *registry.mixing_rules)),
        ("friction_mixing", (*MIXING_RULES, *registry.mixing_rules)),
        ("broad_phase", (AUTOMATIC, *registry.broad_phases)),
    ):
        value = getattr(settings, name)
        if value not in known:
            hint = did_you_mean(value, known)
            raise ValueError(f"Settings.{name} must be one of {', '.join(known)}, got {value!r}{hint}")


def write_settings(state: Record, settings: Settings, registry: Registry) -> None:
    """Write the numbers that stages read into the state."""
    state.dt_cubed, state.substeps = cubed(settings.dt), settings.substeps
    state.mode = MODES[settings.collision]
    state.slop = -1.0 if settings.slop is None else float(settings.slop)
    threshold = settings.restitution_threshold
    state.restitution_threshold = -1.0 if threshold is None else float(threshold)
    state.max_impacts = settings.max_impacts_per_step
    state.restitution_rule = rule_number(registry, settings.restitution_mixing)
    state.friction_rule = rule_number(registry, settings.friction_mixing)


def gravity_vector(gravity: Any, dimensions: int) -> np.ndarray:
    """(d,) m/s^2, read-only; 0 means no gravity, ValueError for anything else that is not d finite numbers."""
    vector = np.array(gravity, float)
    if vector.ndim == 0 and vector == 0:
        vector = np.zeros(dimensions)
    if vector.shape != (dimensions,) or not np.isfinite(vector).all():
        raise ValueError(f"gravity must be {dimensions} finite numbers, got {gravity!r}")
    vector.flags.writeable = False
    return vector


def cubed(dt: float) -> float:
    """dt^3, inf where that overflows."""
    return dt * dt * dt if dt < 1e100 else math.inf
