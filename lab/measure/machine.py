"""Where a measurement was made: the processor, the system and the versions."""

from __future__ import annotations

import importlib.metadata
import platform
from pathlib import Path

from .timing import CLOCK

PACKAGES = ("carom", "numba", "numpy", "esper", "pymunk", "pyb2d3")


def machine() -> dict[str, str]:
    """The environment of the measurement: processor, versions, clock."""
    versions = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = "missing"
    return {"processor": _processor(), "system": platform.system(), "clock": CLOCK, **versions}


def machine_line(machine: dict[str, str]) -> str:
    """Processor and system, then versions, then the clock."""
    others = ("processor", "system", "clock")
    versions = ", ".join(f"{name} {version}" for name, version in machine.items() if name not in others)
    return f"{machine['processor']}, {machine['system']}; {versions}; {machine['clock']}"


def _processor() -> str:
    """The processor's name; on Linux from /proc, because Python does not provide it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
