"""The tests have a kernel cache of their own, never the user's: made once, shared by all workers, kept between runs.

Its kernels are made for any processor of this platform, as those in a wheel are: the tests run what ships. Where there
is a linker they are a library; what is edited since compiles. ``CAROM_LIBRARY=0`` runs the tests without it.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

CACHE = Path(__file__).resolve().parent.parent / ".kernels"

os.environ["CAROM_BACKGROUND"] = "0"  # what compiles, and when, depends on no thread
# Before anything imports carom or numba, and for all processes that tests start:
os.environ["CAROM_CACHE_DIR"] = str(CACHE)
os.environ.update({"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""})


def pytest_configure(config):
    """Tests look at world.faults; those of warnings set filters of their own."""
    config.addinivalue_line("filterwarnings", "ignore::carom.framework.PhysicsWarning")


def pytest_collection_modifyitems(config, items):
    """What is marked long runs only if it is asked for; all workers collect in the same order."""
    if "long" not in config.option.markexpr:
        long = [item for item in items if item.get_closest_marker("long")]
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if not item.get_closest_marker("long")]
    items.sort(key=lambda item: bool(item.get_closest_marker("last")) - bool(item.get_closest_marker("early")))


def pytest_collection_finish(session):
    """What is loaded by now stays: collections of garbage need not look at it again and again."""
    gc.collect()
    gc.freeze()


def pytest_sessionstart(session):
    """With several workers: compile what nearly all tests need before they start, or each would do it."""
    config = session.config
    is_worker, several = hasattr(config, "workerinput"), (getattr(config.option, "numprocesses", None) or 1) > 1
    if is_worker or not several or os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return
    with config.pluginmanager.getplugin("capturemanager").global_and_fixture_disabled():
        print(f"kernels of all that ships: loading or compiling, kept in {CACHE.name}", file=sys.stderr, flush=True)
        kept = find_spec("carom._kernels") is not None
        for command in ["warm-up"] if kept else ["build", "warm-up"]:  # they say how many are left
            done = subprocess.run([sys.executable, "-m", "carom", command], stdout=subprocess.DEVNULL)
            if command == "build" and done.returncode == 0:
                break  # a library has all of them
