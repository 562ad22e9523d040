"""Errors of the framework; plain wrong values are ValueError, wrong names KeyError or AttributeError."""

import sys
import warnings


class CaromError(Exception):
    """Base of carom's own errors."""


class NoPhysicsError(CaromError, AttributeError):
    """Something was asked of a world that no plugin has filled yet."""


class MissingComponentError(CaromError):
    """An entity has a component that is meaningless without another one."""


class StepError(CaromError):
    """A system raised inside a step; carom's columns and clock are back at the start of that step."""


class FaultError(CaromError):
    """A step has found a fault, and ``Settings.on_fault`` is "raise"; the step is complete."""


class PhysicsWarning(UserWarning):
    """A fault, see ``world.faults``: once for each kind and body, if ``Settings.on_fault`` is "warn"."""


def warn(text: str) -> None:
    """A PhysicsWarning at the code that has called carom, or called it through esper."""
    frame, depth = sys._getframe(0), 1
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] in ("carom", "esper"):
        frame, depth = frame.f_back, depth + 1
    warnings.warn(text, PhysicsWarning, stacklevel=depth)


class UnhandledPairError(CaromError):
    """Two shapes can meet in this world and no plugin says how."""


class PluginError(CaromError, ValueError):
    """A plugin is not what it should be; the message names plugin, shape, function and the cure."""


class LibraryError(CaromError, ImportError):
    """A library of compiled kernels cannot be used, or lacks one that nothing here can compile."""


class ScheduleError(CaromError):
    """Systems cannot be put in order: a cycle, or two writers of one column without an order."""
