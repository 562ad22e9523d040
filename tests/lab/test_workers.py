"""Tasks in worker processes: every one is finished once, whatever happens to the workers."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import helpers_workers
import pytest
from helpers_workers import Task, alive, marks, perform, until

import carom
from carom.framework.compilation import log
from carom.lab.jobs.workers import Lost, in_parallel

pytestmark = pytest.mark.slow  # many runs: half a minute or more together

needs_signals = pytest.mark.skipif(os.name == "nt", reason="there are no signals of this kind")


@pytest.fixture(autouse=True)
def no_worker_is_left():
    yield
    until(lambda: not multiprocessing.active_children())


def tasks_of(folder: Path, *what: str) -> list[Task]:
    return [Task(name, str(folder), number) for number, name in enumerate(what)]


# -- what comes back --------------------------------------------------------------------------------------------


def test_each_task_gives_its_result_once_from_processes_of_their_own(tmp_path):
    tasks = tasks_of(tmp_path, *["square"] * 9)
    results = list(in_parallel(perform, tasks, workers=2))
    assert sorted(results) == [(task, task.number**2) for task in tasks]
    assert marks(tmp_path) == [str(number) for number in range(9)]
    pids = {int(path.read_text()) for path in tmp_path.iterdir()}
    assert os.getpid() not in pids
    assert len(pids) <= 2


def test_a_long_task_keeps_no_other_from_running(tmp_path):
    """The first one ends only when all others have begun: one worker has to do them all."""
    tasks = tasks_of(tmp_path, *["square"] * 6)
    tasks = [Task("wait_for_others", str(tmp_path), 7), *tasks]
    *_, last = in_parallel(perform, tasks, workers=2)
    assert last == (tasks[0], 49)


@pytest.mark.parametrize("announced", [False, True])
def test_one_process_of_all_says_that_it_compiles(tmp_path, monkeypatch, announced):
    monkeypatch.setattr(log, "announced", announced)
    found = [announces for _, announces in in_parallel(perform, tasks_of(tmp_path, "announces", "announces"), 2)]
    assert sorted(found) == [False, not announced]


@pytest.mark.parametrize("number", [0, -1, 1.5, True, "2"])
def test_a_number_of_workers_that_is_none(number):
    with pytest.raises(ValueError, match="workers"):
        in_parallel(perform, [], workers=number)


# -- workers that die -------------------------------------------------------------------------------------------


@needs_signals
def test_the_task_of_a_killed_worker_runs_again_and_counts_once(tmp_path):
    tasks = tasks_of(tmp_path, "square", "killed_once", "square", "square", "killed_once", "square")
    results = list(in_parallel(perform, tasks, workers=2))
    assert sorted(results, key=lambda pair: pair[0].number) == [(task, task.number**2) for task in tasks]
    assert {"0", "1", "1 again", "2", "3", "4", "4 again", "5"} <= set(marks(tmp_path))


@needs_signals
def test_a_task_that_always_ends_its_worker_is_lost_and_no_other(tmp_path):
    tasks = tasks_of(tmp_path, "killed", "square", "exits", "exits", "square")
    results = dict(in_parallel(perform, tasks, workers=2))
    assert {task.number: result for task, result in results.items() if not isinstance(result, Lost)} == {1: 1, 4: 16}
    lost = {task.number: result for task, result in results.items() if isinstance(result, Lost)}
    assert {number: result.task for number, result in lost.items()} == {n: tasks[n] for n in (0, 2, 3)}
    assert lost[0].reason == "its process ended 2 times"
    assert {"0", "1", "2", "3", "4"} <= set(marks(tmp_path))


# -- errors and ends --------------------------------------------------------------------------------------------


def test_an_error_ends_everything_and_is_raised_here(tmp_path):
    with pytest.raises(ValueError, match="number 0") as raised:
        list(in_parallel(perform, tasks_of(tmp_path, "fails", "last_for_ever", "square"), workers=2))
    assert "in fails" in str(raised.value.__cause__)  # the worker's traceback
    assert "2" not in marks(tmp_path)


def test_closing_early_ends_the_workers(tmp_path):
    tasks = tasks_of(tmp_path, "square", "last_for_ever", "last_for_ever", "square")
    with closing(in_parallel(perform, tasks, workers=2)) as results:
        assert next(results) == (tasks[0], 0)
        until(lambda: "1" in marks(tmp_path))
        assert multiprocessing.active_children()
    until(lambda: not multiprocessing.active_children())
    assert "3" not in marks(tmp_path)


def started(folder: Path, script: str, **more) -> subprocess.Popen[str]:
    """A user script without a guard, in a separate session; its output and errors."""
    (folder / "script.py").write_text(script)
    return subprocess.Popen(
        [sys.executable, str(folder / "script.py")], cwd=folder, start_new_session=True, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, **more,
    )  # fmt: skip


ENDLESS = f"""
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background of a shell
sys.path.append({str(Path(__file__).parents[1])!r})
from helpers_workers import Task, perform
from carom.lab.jobs.workers import in_parallel
print("begins", flush=True)
for _ in in_parallel(perform, [Task("last_for_ever", "marks", number) for number in range(4)], workers=2):
    pass
"""


@needs_signals
@pytest.mark.parametrize("when", ["at work", "starting"])
def test_an_interruption_of_the_terminal_ends_all_without_a_word_from_the_workers(tmp_path, when):
    (tmp_path / "marks").mkdir()
    with started(tmp_path, ENDLESS) as script:
        assert script.stdout is not None
        script.stdout.readline()
        if when == "at work":
            until(lambda: marks(tmp_path / "marks") == ["0", "1"])
        os.killpg(script.pid, signal.SIGINT)
        _, errors = script.communicate(timeout=helpers_workers.DEADLINE)
        assert errors.count("Traceback") == 1  # the script's own
        assert errors.rstrip().endswith("KeyboardInterrupt")
        until(lambda: not alive(-script.pid))  # no other process of its session either


@needs_signals
def test_workers_do_not_outlive_a_killed_parent(tmp_path):
    (tmp_path / "marks").mkdir()
    with started(tmp_path, ENDLESS) as script:
        until(lambda: marks(tmp_path / "marks") == ["0", "1"])
        pids = [int(mark.read_text()) for mark in (tmp_path / "marks").iterdir()]
        assert all(map(alive, pids))
        script.kill()
        until(lambda: not any(map(alive, pids)))


# -- tasks that run here, and the imports of workers ------------------------------------------------------------


def test_one_worker_is_this_process(tmp_path):
    assert list(in_parallel(helpers_workers.process, [3, 1, 2], workers=1)) == [(n, os.getpid()) for n in (3, 1, 2)]


def test_a_function_that_cannot_be_sent_runs_here_in_order():
    ran = []
    assert list(in_parallel(lambda number: ran.append(number), range(4), workers=2)) == [(n, None) for n in range(4)]
    assert ran == [0, 1, 2, 3]


@pytest.mark.parametrize("others", [0, 2])
def test_a_task_that_cannot_be_sent_runs_here_and_the_others_there(others):
    tasks = [*range(others), lambda: 2]
    results = list(in_parallel(helpers_workers.process, tasks, workers=2))
    assert [task for task, pid in results if pid == os.getpid()] == tasks[others:]
    assert {task for task, _ in results} == {*tasks}


def test_a_worker_has_no_workers():
    for number, inner in in_parallel(helpers_workers.nested, [3, 4], workers=2):
        assert [n for n, _ in inner] == list(range(number))
        assert len({pid for _, pid in inner} - {os.getpid()}) == 1


SCRIPT = """
import os
import carom
from carom.framework.compilation import log
from carom.lab.jobs.workers import in_parallel
from own_module import where

def own(number):
    return os.getpid()

print("once")
for task, (pid, carom_there) in in_parallel(where, range(2), workers=2):
    print("elsewhere", pid != os.getpid(), carom_there == carom.__file__)
for task, pid in in_parallel(own, range(1), workers=2):
    print("here", pid == os.getpid())
"""

OWN_MODULE = """
import os
import carom.lab.jobs.workers

def where(number):
    print("said by a worker\\n", end="")  # in one write, so that two processes do not mix
    os.system("echo said by its child")
    return os.getpid(), carom.__file__
"""


@needs_signals
def test_a_script_without_a_guard_whose_modules_are_found_by_pythonpath(tmp_path):
    """Workers find carom and the user's modules where the script does, never run the script, and leave stdout alone."""
    root = Path(str(carom.__file__)).parent
    package = tmp_path / "path" / "carom"
    package.mkdir(parents=True)
    (package / "__init__.py").write_bytes(Path(str(carom.__file__)).read_bytes())
    for layer in ("framework", "lab", "scenes", "components", "systems", "plugins"):
        (package / layer).symlink_to(root / layer)
    (tmp_path / "path" / "own_module.py").write_text(OWN_MODULE)
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "path")}
    with started(tmp_path, SCRIPT, env=environment) as script:
        printed, errors = script.communicate(timeout=helpers_workers.DEADLINE)
    assert printed.splitlines() == ["once", *["elsewhere True True"] * 2, "here True"]
    assert sorted(errors.splitlines()) == ["said by a worker"] * 2 + ["said by its child"] * 2
