"""Settings of a world: every dial between speed and accuracy, with its unit and default."""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import Any, Self

from .names import did_you_mean
from .units import warn_of_rate

MIXING_RULES = ("average", "geometric_mean", "max", "min", "multiply")
COLLISION_MODES = ("discrete", "continuous", "event_driven")
GEOMETRY_MODES = ("precise", "bounds")
FAULT_MODES = ("warn", "raise", "ignore")
# What other engines call a field: only for messages about a wrong name.
OTHER_WORDS = {
    "iterations": "substeps", "velocity_iterations": "substeps", "solver_iterations": "substeps", "timestep": "dt",
}  # fmt: skip
AUTOMATIC = "automatic"  # the broad phase that suits the scene


@dataclass(frozen=True)
class Settings:
    """Frozen; change a copy: ``settings.replace(dt=1/120)``. ValueError names the field that is out of range.

    dt
        the fixed step, seconds
    substeps
        of the solver for contacts at rest; never changes free flight
    integrator
        explicit_euler, semi_implicit_euler, velocity_verlet, rk4, yoshida4, or one that a plugin brings
    collision
        discrete: contacts are found from the overlap at the end of the step, but for bodies with ``ccd``; continuous:
        what is fast for its size is swept along its path and bounces where it first touches; event_driven: all impacts
        are taken at their true time and in the order of time
    geometry
        precise: the last level of a body's colliders decides; bounds: the first
    restitution_threshold
        approach speed, m/s, below which a contact is at rest instead of bouncing; None: 2 |a| dt, gravity's share of
        the step
    slop
        how near, m, bodies are held as contacts before they touch, and how much touching corners are ignored; None:
        0.005 of the smaller body of the pair
    max_steps_per_advance
        what one ``advance`` takes at most; the time beyond it is dropped and counted
    max_impacts_per_step
        of one body in one step, of those that gain or lose energy if all is driven by events; beyond it the solver for
        contacts at rest takes over, or a fast body stops until the step ends, and it is counted
    restitution_mixing, friction_mixing
        how the values of the two bodies become the contact's: average, geometric_mean, max, min, multiply, or one that
        a plugin brings
    broad_phase
        automatic: what suits the scene, see ``world.plan()``; or one that a plugin brings
    debug
        check the bodies' state for non-finite values at every system, not only after the flight
    on_fault
        warn: PhysicsWarning and a line of the logger ``carom``, once for each kind of fault and body; raise: FaultError
        at the end of the step that found it, which is complete; ignore: nothing. All are in ``world.faults``
    sleeping
        islands of bodies that have been at rest for half a second take no part in steps until something touches one of
        them or changes it
    """

    dt: float = 1 / 60
    substeps: int = 4
    integrator: str = "semi_implicit_euler"
    collision: str = "discrete"
    geometry: str = "precise"
    restitution_threshold: float | None = None
    slop: float | None = None
    max_steps_per_advance: int = 8
    max_impacts_per_step: int = 64  # blows run to and fro between bodies that touch, and a gap is crossed as often
    restitution_mixing: str = "max"
    friction_mixing: str = "geometric_mean"
    broad_phase: str = "automatic"
    debug: bool = False
    on_fault: str = "warn"
    sleeping: bool = False

    def __post_init__(self) -> None:
        self._number("dt", above=0.0)
        warn_of_rate("Settings.dt", self.dt)
        for name in ("restitution_threshold", "slop"):
            if getattr(self, name) is not None:
                self._number(name, least=0.0)
        for name in ("substeps", "max_steps_per_advance", "max_impacts_per_step"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ValueError(f"Settings.{name} must be a whole number from 1, got {value!r}")
        for name in ("integrator", "restitution_mixing", "friction_mixing", "broad_phase"):  # a plugin may bring it
            if not isinstance(getattr(self, name), str) or not getattr(self, name):
                raise ValueError(f"Settings.{name} must be a name, got {getattr(self, name)!r}")
        for name in ("debug", "sleeping"):
            if not isinstance(getattr(self, name), bool):
                raise ValueError(f"Settings.{name} must be True or False, got {getattr(self, name)!r}")
        for name, known in (
            ("collision", COLLISION_MODES),
            ("geometry", GEOMETRY_MODES),
            ("on_fault", FAULT_MODES),
        ):
            if getattr(self, name) not in known:
                raise ValueError(f"Settings.{name} must be one of {', '.join(known)}, got {getattr(self, name)!r}")

    def _number(self, name: str, above: float | None = None, least: float | None = None) -> None:
        value: Any = getattr(self, name)
        number = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
        if not number or (above is not None and value <= above) or (least is not None and value < least):
            rule = f"above {above:g}" if above is not None else f"at least {least:g}"
            raise ValueError(f"Settings.{name} must be a finite number {rule}, got {value!r}")

    def replace(self, **changes: Any) -> Self:
        """A copy with the ``changes``; TypeError for a field that does not exist."""
        _refuse_unknown(changes)
        return dataclasses.replace(self, **changes)

    @classmethod
    def fast(cls) -> Self:
        """Large worlds of small things: two substeps, the cheap level of geometry."""
        return cls(substeps=2, geometry="bounds")

    @classmethod
    def balanced(cls) -> Self:
        """The default."""
        return cls()

    @classmethod
    def accurate(cls) -> Self:
        """Velocity Verlet, a smaller step, what is fast swept along its path, 32 substeps for what rests."""
        return cls(dt=1 / 240, integrator="velocity_verlet", collision="continuous", substeps=32)


def _refuse_unknown(values: dict[str, Any]) -> None:
    known = [field.name for field in dataclasses.fields(Settings)]
    for name in values:
        if name not in known:
            near = did_you_mean(name, known, OTHER_WORDS)
            raise TypeError(f"Settings has no field {name!r}{near}; it has {', '.join(known)}")


_generated = Settings.__init__


@functools.wraps(_generated)
def _init(self: Settings, *args: Any, **values: Any) -> None:
    _refuse_unknown(values)
    _generated(self, *args, **values)


def _set(self: Settings, name: str, value: Any) -> None:
    _refuse_unknown({name: value})
    raise dataclasses.FrozenInstanceError(
        f"Settings are frozen: world.settings = world.settings.replace({name}={value!r})"
    )


Settings.__init__ = _init  # type: ignore[method-assign]
Settings.__setattr__ = _set  # type: ignore[method-assign]
