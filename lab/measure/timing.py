"""The clock of all measurements of time, and the machine they are made on."""

from __future__ import annotations

import gc
import importlib.metadata
import platform
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ...framework import PhysicsWarning
from ...framework.compilation import log

PACKAGES = ("carom", "numba", "numpy", "esper", "pymunk", "pyb2d3")
FINE = 1e-6  # s: a coarser clock cannot time a block of steps


def _choose() -> tuple[str, Callable[[], float]]:
    """Processor time if its resolution is fine enough: it excludes the time of other programs."""
    if time.get_clock_info("process_time").resolution <= FINE:
        return "processor time", time.process_time
    return "wall time", time.perf_counter


CLOCK, now = _choose()


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Switch Python's garbage collector off inside."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def timed(work: Callable[[], Any], clock: Callable[[], float] = now) -> tuple[float, bool, Any]:
    """Seconds that ``work`` took, whether they are valid (no kernel was compiled or loaded), and its result."""
    waited = log.waited
    started = clock()
    result = work()
    seconds = clock() - started
    return seconds, log.waited == waited, result


@contextmanager
def faults_in_results() -> Iterator[None]:
    """No warnings of faults meanwhile; a decorator, too."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PhysicsWarning)
        yield


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
