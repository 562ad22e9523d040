"""Python programs in processes of their own, forked from one that has loaded numba and numpy, but nothing of carom.

That saves half a second per process. Every process gets its environment, folder, arguments and output as a new one
does; the variables that count where numba is loaded make a new Python start.
"""

from __future__ import annotations

import atexit
import functools
import io
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
import types
from pathlib import Path
from unittest import mock

# numba itself, and what it imports when it compiles for the first time.
PRELOAD = [
    "esper", "numpy.ma", "numba", "numba.core.inline_closurecall", "numba.cpython.heapq", "numba.cpython.printimpl",
    "numba.cpython.randomimpl", "numba.experimental.jitclass.base", "numba.misc.cffiimpl", "numba.np.linalg",
    "numba.np.npyimpl", "numba.np.polynomial", "numba.np.random.generator_methods", "numba.typed.dictimpl",
    "numba.typed.listobject", "numba.typed.setobject", "helpers_numba_loaded",
]  # fmt: skip
NATIVE = {"NUMBA_CPU_NAME": None, "NUMBA_CPU_FEATURES": None}  # code for this processor, as players have it
AT_LOADING = {"PYTHONHASHSEED", "NUMBA_DISABLE_JIT", "NUMBA_OPT", *NATIVE}
FORKED = sys.platform.startswith("linux")  # elsewhere system libraries do not survive it
PATIENCE = 900  # seconds: what takes longer hangs
RUN_CAROM = "import runpy; runpy.run_module('carom', run_name='__main__')"

# What a packed game is to carom: neither numba nor llvmlite can be imported.
NO_COMPILER = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("numba", "llvmlite"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Missing())
"""

Environment = dict[str, "str | None"]  # None: without that variable


def with_variables(environment: Environment) -> dict[str, str]:
    """The environment of here with these changes."""
    changed = {**os.environ, **environment}
    return {name: value for name, value in changed.items() if value is not None}


class Started:
    """A program that runs; ``finish`` waits for its end."""

    def __init__(self, code: str, arguments: tuple, cwd: Path | None, environment: Environment) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="carom-process-")
        self._arguments = [str(argument) for argument in arguments]
        everything = with_variables(environment)
        files = [os.path.join(self._folder.name, name) for name in ("stdout", "stderr")]
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(PRELOAD)
        self._process = context.Process(
            target=_execute, args=(code, self._arguments, str(cwd or Path.cwd()), everything, files, _byte_code().name)
        )
        nothing = {"__main__": types.ModuleType("__main__")}  # or it would import pytest
        with mock.patch.dict(sys.modules, nothing), mock.patch.dict(os.environ, PYTHONPATH=os.path.dirname(__file__)):
            self._process.start()

    def finish(self) -> subprocess.CompletedProcess[str]:
        self._process.join(PATIENCE)
        self._process.kill()
        self._process.join()
        output = [Path(self._folder.name, name).read_text(encoding="utf-8") for name in ("stdout", "stderr")]
        self._folder.cleanup()
        return subprocess.CompletedProcess(self._arguments, self._process.exitcode, *output)


class StartedAnew:
    """The same in a new Python."""

    def __init__(self, code: str, arguments: tuple, cwd: Path | None, environment: Environment) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", code, *map(str, arguments)], cwd=cwd, env=with_variables(environment), text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def finish(self) -> subprocess.CompletedProcess[str]:
        with self._process:
            try:
                output = self._process.communicate(timeout=PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                raise
        return subprocess.CompletedProcess(self._process.args, self._process.returncode, *output)


@functools.cache
def _byte_code() -> tempfile.TemporaryDirectory:
    """Where processes keep what they have read of carom's sources, whatever PYTHONDONTWRITEBYTECODE says."""
    return tempfile.TemporaryDirectory(prefix="carom-byte-code-")


def start_python(code: str, *arguments, cwd: Path | None = None, anew: bool = False, **environment: str | None):
    """Start ``code`` as ``python -c`` does; anew: without fork; environment: changes of that of here, None: without."""
    anew = anew or not FORKED or not AT_LOADING.isdisjoint(environment)
    return (StartedAnew if anew else Started)(code, arguments, cwd, environment)


def run_python(code: str, *arguments, **more) -> subprocess.CompletedProcess[str]:
    """The same, and wait for its end."""
    return start_python(code, *arguments, **more).finish()


def output_of(code: str, *arguments, **more) -> str:
    """What it prints, if it ends well."""
    done = run_python(code, *arguments, **more)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def run_carom(*arguments, **more) -> subprocess.CompletedProcess[str]:
    """The command ``carom`` with these arguments."""
    return run_python(RUN_CAROM, *arguments, **more)


def _link_or_copy(source: str, target: str) -> None:
    """Files of kernels are replaced, never written into: a link does, and takes no part of their half a gigabyte."""
    try:
        os.link(source, target)
    except OSError:  # on another disk
        shutil.copyfile(source, target)


def copied_cache(folder: Path, *without: str) -> dict[str, str]:
    """A copy of the tests' kernel cache without the kernels of these names: the environment of processes to use it."""
    ignored = shutil.ignore_patterns("*.unfinished", "hypothesis", *(f"{name}-*.kernel" for name in without))
    os.makedirs(os.environ["CAROM_CACHE_DIR"], 0o700, exist_ok=True)
    shutil.copytree(
        os.environ["CAROM_CACHE_DIR"], folder, ignore=ignored, copy_function=_link_or_copy, dirs_exist_ok=True
    )
    return {"CAROM_CACHE_DIR": str(folder), "CAROM_LIBRARY": "0"}


def _execute(
    code: str, arguments: list[str], cwd: str, environment: dict[str, str], files: list[str], byte_code: str
) -> None:
    """In the new process: become ``python -c code``."""
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(cwd)
    for number, file in enumerate(files, 1):
        opened = os.open(file, os.O_WRONLY | os.O_CREAT)
        os.dup2(opened, number)
        os.close(opened)
    sys.stdout = io.TextIOWrapper(open(1, "wb", closefd=False), encoding="utf-8")  # noqa: SIM115
    sys.stderr = io.TextIOWrapper(open(2, "wb", closefd=False), encoding="utf-8", line_buffering=True)  # noqa: SIM115
    from numba.core import config

    config.reload_config()
    sys.pycache_prefix, sys.dont_write_bytecode = byte_code, False
    sys.argv, sys.path[:0] = ["-c", *arguments], [""]
    sys.modules["__main__"] = main = types.ModuleType("__main__")
    try:
        exec(compile(code, "<string>", "exec", dont_inherit=True), vars(main))
    finally:
        atexit._run_exitfuncs()
        sys.stdout.flush()
