"""The built-in systems, in the order of a step: forces, integration, broad phase, narrow phase, response."""

from .broad_phase import BroadPhase
from .contact_events import ContactEvents
from .force_accumulation import ForceAccumulation
from .integration import Integration
from .integrators import CUBIC, LINE, PARABOLA, Integrator
from .narrow_phase import NarrowPhase
from .response import Response
from .spatial_tree import CandidateLimitError, SpatialTree

__all__ = [
    "CUBIC",
    "LINE",
    "PARABOLA",
    "BroadPhase",
    "CandidateLimitError",
    "ContactEvents",
    "ForceAccumulation",
    "Integration",
    "Integrator",
    "NarrowPhase",
    "Response",
    "SpatialTree",
]
