"""Time from the start of a new process to the end of its first step, with an empty and with a filled kernel cache."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from ....framework.jit.cache import CACHE_FOLDER_VARIABLE
from ...commands.usage_errors import Problem
from ...measure.timing import Spread
from ...reporting.progress_bar import NO_PROGRESS, Progress
from ...reporting.text_tables import TextTable
from ..report import digits, span
from ..results import machine

PROGRAM = "from carom import scenes; scenes.get({scene!r}).build().step(); import os; os._exit(0)"
IMPORT_ALONE = "import carom.scenes, os; os._exit(0)"
TARGETS = {"empty cache": 5.0, "warm cache": 1.0}  # s


@dataclass
class Startup:
    """Wall-clock seconds from starting the process, by state of the cache; "import alone" takes no step."""

    scene: str
    machine: dict[str, str]
    seconds: dict[str, Spread]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, plain: dict[str, Any]) -> Self:
        """The inverse of :meth:`as_dict`, also after JSON."""
        return cls(**{**plain, "seconds": {name: Spread.from_dict(s) for name, s in plain["seconds"].items()}})


def startup(scene: str = "gas2d", repeats: int = 3, progress: Progress = NO_PROGRESS) -> Startup:
    """Start processes that build ``scene`` and take one step; each repeat starts with an empty cache folder."""
    program = PROGRAM.format(scene=scene)
    found: dict[str, list[float]] = {"empty cache": [], "warm cache": [], "import alone": []}
    progress.begin(repeats)
    for repeat in range(repeats):
        progress.say(f"{scene}, repeat {repeat + 1} of {repeats}")
        with tempfile.TemporaryDirectory() as folder:
            for name, code in zip(found, (program, program, IMPORT_ALONE), strict=True):
                found[name].append(_seconds(code, Path(folder)))
        progress.advance(1)
    return Startup(scene, machine(), {name: Spread.of(values) for name, values in found.items()})


def _seconds(code: str, cache: Path) -> float:
    environment = {**os.environ, CACHE_FOLDER_VARIABLE: str(cache)}
    started = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    seconds = time.perf_counter() - started
    if done.returncode:
        raise Problem(f"the process that was timed failed: {(done.stderr.splitlines() or ['no message'])[-1]}")
    return seconds


def table(result: Startup) -> TextTable:
    """The times as a table."""
    cells = [
        (name, digits(spread.median), span(spread), f"{TARGETS[name]:g}" if name in TARGETS else "-")
        for name, spread in result.seconds.items()
    ]
    repeats = len(result.seconds["empty cache"].values)
    title = f"{result.scene}: seconds from starting the process to the end of the first step, medians of {repeats}"
    return TextTable(title, ("cache", "s", "from .. to", "target"), cells)
