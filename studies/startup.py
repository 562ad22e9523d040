"""Starting a game: the time to its first step and its longest later step, by what is compiled already."""

from __future__ import annotations

import functools
import json
import os
import subprocess
import sys
import tempfile
import time

from carom import scenes
from carom.framework.jit.cache import CACHE_FOLDER_VARIABLE
from carom.framework.jit.libraries import OFF
from carom.lab.cli.usage_errors import Problem
from carom.lab.reporting.text import TextTable, compact, span

from .runner import Axis, Result

STEPS = 600  # after the first
EMPTY, KEPT, SHIPPED = "none", "kept on disk", "shipped"  # kernels that are compiled already
PROGRAM = f"""
import json, sys, time
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
found = {{"at": at, "imports": imported, "first": first - imported, "worst": worst, "compiled": len(log.compiled)}}
# On Linux; what a process is told of its resources counts that of which it was forked.
found["peak"] = int(next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1]) / 1024
print(json.dumps(found))
"""


def axes(quick: bool = False) -> list[Axis]:
    """Each scene of the library."""
    del quick
    return [Axis(name, "", (name,), _starts) for name in scenes.names()]


def _starts(scene: str, repeat: int) -> dict[str, float]:
    """Three processes that build the scene and step it: with an empty cache folder, with what the first has left there,
    and with another empty one and kernels that were shipped."""
    with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as other:
        started = {EMPTY: _start(scene, cache, ""), KEPT: _start(scene, cache, "")}
        started[SHIPPED] = _start(scene, other, _shipped(scene).name)
    return {f"{kernels} {name}": value for kernels, found in started.items() for name, value in found.items()}


@functools.cache
def _shipped(scene: str) -> tempfile.TemporaryDirectory[str]:
    """A folder with the scene's kernels, as a game ships them."""
    folder = tempfile.TemporaryDirectory()
    _ship(scene, folder.name)
    return folder


def _ship(scene: str, folder: str) -> None:
    _run("-m", "carom", "build", scene, "--out", folder, **{OFF: "0"})


def _start(scene: str, cache: str, shipped: str) -> dict[str, float]:
    """Of one process, by name: seconds by the wall clock to the end of its first step; processor seconds of imports and
    of building the world with the first step; seconds of the longest step after it; kernels that were compiled; MB."""
    started = time.time()
    environment = {CACHE_FOLDER_VARIABLE: cache, **({} if shipped else {OFF: "0"})}
    found = json.loads(_run("-c", PROGRAM, scene, shipped, **environment))
    return {"seconds": found.pop("at") - started, **found}


def _run(*words: str, **environment: str) -> str:
    done = subprocess.run((sys.executable, *words), env={**os.environ, **environment}, capture_output=True, text=True)
    if done.returncode:
        raise Problem(f"the process that was timed failed: {(done.stderr.splitlines() or ['no message'])[-1]}")
    return done.stdout


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """Three rows for each scene."""
    rows = []
    for sample in (sample for line in result.lines for sample in line.samples):
        for kernels in (EMPTY, KEPT, SHIPPED):
            compiled, seconds, imports, first, worst, peak = (
                sample.figures[f"{kernels} {name}"]
                for name in ("compiled", "seconds", "imports", "first", "worst", "peak")
            )
            rows.append((
                sample.value, kernels, f"{compiled.median:.0f}", compact(seconds.median), span(seconds),
                compact(imports.median), compact(first.median), compact(1e3 * worst.median), f"{peak.median:.0f}",
            ))  # fmt: skip
    columns = (
        "scene", "kernels", "compiled", "first step after s", "from .. to", "imports CPU s", "first step CPU s",
        f"worst of {STEPS} ms", "peak MB",
    )  # fmt: skip
    title = "from starting a process to the end of its first step, and the longest step after it, medians of "
    return [TextTable(f"{title}{result.repeats}", columns, rows)], []
