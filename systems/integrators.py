"""The integrators, at the path that users import: those that carom brings, and the base class for others."""

from .integration.integrators import (
    CUBIC,
    LINE,
    PARABOLA,
    STANDARD_INTEGRATORS,
    ExplicitEuler,
    Integrator,
    RungeKutta4,
    SemiImplicitEuler,
    VelocityVerlet,
    Yoshida4,
)

__all__ = [
    "CUBIC",
    "LINE",
    "PARABOLA",
    "STANDARD_INTEGRATORS",
    "ExplicitEuler",
    "Integrator",
    "RungeKutta4",
    "SemiImplicitEuler",
    "VelocityVerlet",
    "Yoshida4",
]
