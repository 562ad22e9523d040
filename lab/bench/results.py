"""Results of a benchmark, as plain records that convert to JSON and back."""

from __future__ import annotations

import importlib.metadata
import platform
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..measure.timing import CLOCK, Spread
from ..plain import Plain

PACKAGES = ("carom", "numba", "numpy", "esper", "pymunk")


@dataclass
class Row(Plain):
    """One window of one scene at one size, or one kind of query.

    ``unit``: what the milliseconds are per; medians of the steps of a repeat, and ``fast``: a tenth of them took
    less. ``ratio``: pymunk's median over carom's, within each repeat.
    ``peer_index``: the pymunk index that was faster in the first repeat; the times are those with it.
    ``settings``: carom's settings that differ from the default.
    ``quality``: figures by engine and name, see :meth:`carom.lab.engines.quality.Quality.figures`.
    """

    scene: str
    variant: str
    bodies: int
    window: str
    unit: str
    timed: int
    target: float | None
    energy: str
    carom_ms: Spread
    carom_fast_ms: Spread
    peer_ms: Spread | None = None
    peer_fast_ms: Spread | None = None
    ratio: Spread | None = None
    peer_index: str | None = None
    compile_seconds: float = 0.0
    settings: dict[str, Any] = field(default_factory=dict)
    quality: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return f"{self.scene}, {self.variant}" if self.variant else self.scene

    @property
    def label(self) -> str:
        """Scene, bodies, and the variant that distinguishes the row."""
        return " ".join(filter(None, (self.scene, f"{self.bodies:,}", self.variant, self.window)))


@dataclass
class Result(Plain):
    """A whole benchmark: machine, settings and rows."""

    machine: dict[str, str]
    settings: dict[str, dict[str, Any]]
    repeats: int
    rows: list[Row]


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
    """Processor and system, then versions."""
    rest = dict(machine)
    place = [rest.pop(key) for key in ("processor", "system") if key in rest]
    clock = [rest.pop("clock")] if "clock" in rest else []
    versions = ", ".join(f"{name} {version}" for name, version in rest.items())
    return "; ".join(filter(None, (", ".join(place), versions, *clock)))


def _processor() -> str:
    """The processor's name; on Linux from /proc, because Python does not provide it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
