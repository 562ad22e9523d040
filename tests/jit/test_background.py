"""Linking many functions: while the game runs, or on several processes; nobody waits, errors arrive here."""

from __future__ import annotations

import os

import pytest
from helpers_processes import copied_cache, output_of

from carom.framework.jit.link_all import CAN_FORK

FUNCTIONS = """
import time
from carom.framework.jit.kinds import FLOAT
from carom.framework.compilation import log
from carom.framework.jit.background import link_in_background, wait
from carom.framework.jit.linking import Linked

signature = FLOAT(FLOAT)


def adding(number):
    def add(x):
        return x + number

    return Linked(add, signature)


def wrong(x):
    return x.nothing
"""
ONE_AFTER_THE_OTHER = """
functions = [adding(1.0), Linked(wrong, signature), adding(2.0)]
link_in_background(functions)
wait()
print([function.ready for function in functions], len(log.compiled), log.waited)
link_in_background([adding(3.0)])  # a thread that has ended is followed by another
wait()
print(len(log.compiled))
try:
    functions[1].link()
except Exception as error:
    print(type(error).__name__)
"""
THE_END = """
link_in_background([adding(float(k)) for k in range(400)])
"""
WORLD = """
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.framework.compilation import log
from carom.framework.jit.background import wait
from carom.plugins import Physics

world = World(Physics(dimensions=2, gravity=(0.0, -9.81)))
world.create_entity(Transform((0.0, -1.0)), AABBCollider((9.0, 1.0)))
world.create_entity(Transform((0.0, 3.0)), RigidBody(), SphereCollider(0.5, restitution=0.5))
world.step()
seconds = world.stats().compile_seconds
wait()
world.step()
print([name for name, _ in log.compiled], world.stats().compile_seconds == seconds)
before = log.loaded
print(len(world.ray_cast((0.0, 5.0), (0.0, -1.0))), log.loaded == before, len(log.compiled))
"""


SEVERAL = """
import sys
from carom.framework.jit.link_all import link_all

log.processes = int(sys.argv[1])
functions = [adding(number) for number in (1.0, 2.0, 3.0, 2.0)]
told = []
log.listeners.append(lambda kernel: told.append(log.left))
link_all(functions)
assert all(function.ready for function in functions)
print(len(log.compiled), log.loaded, sorted(set(told), reverse=True), log.left)
try:
    link_all([Linked(wrong, signature) for _ in range(2)])
except Exception as error:
    print(type(error).__name__, "nothing" in str(error), log.left)
"""


def run(code, cache, background="1"):
    environment = {"CAROM_LIBRARY": "0", "CAROM_CACHE_DIR": str(cache), "CAROM_BACKGROUND": background}
    return output_of(code, anew=True, **environment).splitlines()


@pytest.mark.slow
def test_one_function_after_the_other_and_nobody_waits(tmp_path):
    lines = run(FUNCTIONS + ONE_AFTER_THE_OTHER, tmp_path)
    assert lines == ["[True, False, True] 2 0.0", "3", "TypingError"]


@pytest.mark.slow
def test_it_ends_with_the_program(tmp_path):
    run(FUNCTIONS + THE_END, tmp_path)
    assert len(list(tmp_path.glob("*.kernel"))) < 400
    assert not list(tmp_path.glob("*.unfinished"))


@pytest.mark.slow
def test_what_queries_need_is_compiled_while_the_game_runs(tmp_path):
    prepared = WORLD[: WORLD.index("world.step()")] + "world.prepare()"
    run(prepared, os.environ["CAROM_CACHE_DIR"], background="0")  # all is in the cache
    copied_cache(tmp_path, "find_hits")
    assert run(WORLD, tmp_path) == ["['find_hits'] True", "2 True 1"]


@pytest.mark.slow
@pytest.mark.skipif(not CAN_FORK, reason="processes are not forked here")
def test_several_processes_compile_the_same_functions_as_one(tmp_path):
    """Of the two that are alike the second is loaded, or compiled by the other process at the same time."""
    printed, files = [], []
    for processes in (1, 2):
        folder = tmp_path / str(processes)
        folder.mkdir()
        printed.append(output_of(FUNCTIONS + SEVERAL, processes, CAROM_CACHE_DIR=str(folder)).splitlines())
        files.append(sorted(path.name for path in folder.glob("*.kernel")))
    assert printed[0][0] == "3 1 [4, 3, 2] 0"
    assert printed[0][1] == printed[1][1] == "TypingError True 0"
    assert files[0] == files[1]
    assert len(files[0]) == 3
