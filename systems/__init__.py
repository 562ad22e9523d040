"""The built-in systems, in the order of a step: forces, integration, broad phase, narrow phase, response."""

from .broad_phase.system import BroadPhase
from .broad_phase.tree.tree import CandidateLimitError, SpatialTree
from .contacts.events import ContactEvents
from .contacts.response import Response
from .forces.accumulation import ForceAccumulation
from .integration.integrators import CUBIC, LINE, PARABOLA, Integrator
from .integration.system import Integration
from .narrow_phase.system import NarrowPhase

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
