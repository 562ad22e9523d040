"""Linking many functions: on several processes the same functions compile, once each, and errors arrive here."""

from __future__ import annotations

import pytest
from helpers_processes import run_python

from carom.framework.jit.link_all import CAN_FORK

PROGRAM = """
import sys
from numba import types
from carom.framework.compilation import log
from carom.framework.jit.link_all import link_all
from carom.framework.jit.linking import Linked

log.processes = int(sys.argv[1])


def add_one(x):
    return x + 1.0


def add_two(x):
    return x + 2.0


def add_three(x):
    return x + 3.0


def wrong(x):
    return x.nothing


signature = types.float64(types.float64)
functions = [Linked(function, signature) for function in (add_one, add_two, add_three, add_two)]
told = []
log.listeners.append(lambda kernel: told.append((kernel, log.left)))
link_all(functions)
assert all(function.ready for function in functions)
print(sorted(name for name, _ in log.compiled), log.loaded, log.left)
print(sorted({left for _, left in told}, reverse=True))
try:
    link_all([Linked(wrong, signature) for _ in range(2)])
except Exception as error:
    print(type(error).__name__, "nothing" in str(error))
print(len(log.compiled), log.left)
"""


def run_program(folder, processes):
    folder.mkdir()
    done = run_python(PROGRAM, processes, CAROM_CACHE_DIR=str(folder))
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines(), sorted(path.name for path in folder.glob("*.kernel"))


@pytest.mark.skipif(not CAN_FORK, reason="processes are not forked here")
def test_several_processes_compile_the_same_functions_as_one(tmp_path):
    alone, files_alone = run_program(tmp_path / "alone", 1)
    together, files_together = run_program(tmp_path / "together", 2)
    # Of the two for add_two the second one is loaded, or compiled by the other process at the same time.
    assert alone[0] == "['add_one', 'add_three', 'add_two'] 1 0"
    assert alone[1] == "[4, 3, 2]"
    assert files_together == files_alone
    assert len(files_alone) == 3
    assert set(eval(together[0].partition("]")[0] + "]")) == {"add_one", "add_two", "add_three"}
    for lines in (alone, together):
        assert lines[2] == "TypingError True"
        assert lines[3].endswith(" 0")
