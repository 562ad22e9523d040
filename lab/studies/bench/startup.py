"""Starting a game: the time to its first step and its longest later step, by what is compiled already."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass

from ....framework.jit.cache import CACHE_FOLDER_VARIABLE
from ...bench.report import digits, span
from ...bench.results import machine
from ...cli.usage_errors import Problem
from ...measure.timing import Spread
from ...plain import Plain
from ...reporting.progress import NO_PROGRESS, Progress
from ...reporting.text_tables import TextTable

STEPS = 600  # after the first
COMMANDS = {
    "python -c pass": ["-c", "pass"],
    "import carom.framework": ["-c", "import carom.framework"],
    "carom --help": ["-m", "carom", "--help"],
    "carom scenes": ["-m", "carom", "scenes"],
}
EMPTY, KEPT, SHIPPED = "none", "kept on disk", "shipped"  # kernels that are compiled already
PROGRAM = f"""
import json, sys, time
import carom.framework.jit.dispatchers  # numba, as the first kernel imports it
from carom import scenes
from carom.framework import use_kernels
from carom.framework.compilation import log
name, shipped = sys.argv[1:]
if shipped:
    use_kernels(shipped)
imported = time.process_time()
world = scenes.get(name).build()
world.step()
first, at = time.process_time(), time.time()
worst = 0.0
for _ in range({STEPS}):
    started = time.perf_counter()
    world.step()
    worst = max(worst, time.perf_counter() - started)
told = {{"at": at, "imports": imported, "first": first - imported, "worst": worst, "compiled": len(log.compiled)}}
print(json.dumps(told))
"""


@dataclass(frozen=True)
class Start:
    """One scene and what was compiled before; ``seconds`` by the wall clock, from starting the process."""

    scene: str
    kernels: str
    seconds: Spread  # to the end of the first step
    imports: float  # CPU s, of Python, numpy, numba and carom
    first_step: float  # CPU s, of building the world and the first step
    worst_step: float  # s, the longest of the steps after it
    compiled: int


@dataclass
class Startup(Plain):
    """All starts that were measured; medians of the repeats. ``commands``: processor seconds."""

    machine: dict[str, str]
    starts: list[Start]
    commands: dict[str, Spread]


def startup(scenes: Sequence[str] = ("asteroids",), repeats: int = 3, progress: Progress = NO_PROGRESS) -> Startup:
    """Start processes that build a scene and step it; the first of each repeat has an empty cache folder."""
    starts = []
    progress.begin(len(scenes) * (repeats + 1))
    commands = {name: Spread.of([_seconds_of(command) for _ in range(repeats)]) for name, command in COMMANDS.items()}
    for scene in scenes:
        found: dict[str, list[dict[str, float]]] = {EMPTY: [], KEPT: [], SHIPPED: []}
        with tempfile.TemporaryDirectory() as portable:
            progress.say(f"{scene}: compiling kernels to ship")
            _ship(scene, portable)
            progress.advance(1)
            for repeat in range(repeats):
                progress.say(f"{scene}, repeat {repeat + 1} of {repeats}")
                with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as nothing:
                    for kernels, folder in ((EMPTY, cache), (KEPT, cache), (SHIPPED, nothing)):
                        found[kernels].append(_start(scene, folder, portable if kernels == SHIPPED else ""))
                progress.advance(1)
        starts += [_of(scene, kernels, runs) for kernels, runs in found.items()]
    return Startup(machine(), starts, commands)


def _seconds_of(command: list[str]) -> float:
    """Processor seconds that it takes in a process of its own."""

    def of_ended() -> float:
        ended = os.times()
        return ended.children_user + ended.children_system

    before = of_ended()
    _run([sys.executable, *command], {})
    return of_ended() - before


def _of(scene: str, kernels: str, runs: list[dict[str, float]]) -> Start:
    def median(name: str) -> float:
        return statistics.median(run[name] for run in runs)

    seconds = Spread.of([run["seconds"] for run in runs])
    return Start(scene, kernels, seconds, median("imports"), median("first"), median("worst"), int(median("compiled")))


def _ship(scene: str, folder: str) -> None:
    _run([sys.executable, "-m", "carom", "warm-up", scene, "--portable", folder], {})


def _start(scene: str, cache: str, shipped: str) -> dict[str, float]:
    """Of one process, by name, and the seconds that have passed until the end of its first step."""
    started = time.time()
    told = json.loads(_run([sys.executable, "-c", PROGRAM, scene, shipped], {CACHE_FOLDER_VARIABLE: cache}))
    return {**told, "seconds": told["at"] - started}


def _run(command: list[str], environment: dict[str, str]) -> str:
    done = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True)
    if done.returncode:
        raise Problem(f"the process that was timed failed: {(done.stderr.splitlines() or ['no message'])[-1]}")
    return done.stdout


def tables(result: Startup) -> list[TextTable]:
    """The times of commands that need no kernel, and those of scenes."""
    cells = [(name, digits(seconds.median), span(seconds)) for name, seconds in result.commands.items()]
    return [TextTable("commands that need no kernel", ("command", "CPU s", "from .. to"), cells), _scenes(result)]


def _scenes(result: Startup) -> TextTable:
    cells = [
        (
            start.scene, start.kernels, str(start.compiled), digits(start.seconds.median), span(start.seconds),
            digits(start.imports), digits(start.first_step), digits(start.worst_step * 1e3),
        )
        for start in result.starts
    ]  # fmt: skip
    repeats = len(result.starts[0].seconds.values)
    columns = (
        "scene", "kernels", "compiled", "first step after s", "from .. to", "imports CPU s", "first step CPU s",
        f"worst of {STEPS} ms",
    )  # fmt: skip
    title = f"from starting a process to the end of its first step, and the longest step after it, medians of {repeats}"
    return TextTable(title, columns, cells)
