"""Tasks for test_workers.py: worker processes can import this module, as pytest adds its folder to the path."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any, NamedTuple

from carom.framework.compilation import log
from carom.lab.jobs import workers

DEADLINE = 300.0  # s, for a loaded machine; reached only by failing tests


class Task(NamedTuple):
    """The function below to call, a folder for marks of completed calls, and a number."""

    what: str
    folder: str
    number: int


def marks(folder: Path) -> list[str]:
    """The started tasks and their counts: `3` and `3 again`."""
    return sorted(path.name for path in folder.iterdir())


def until(condition: Any) -> None:
    """Wait for the condition, up to DEADLINE."""
    end = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def perform(task: Task) -> Any:
    """Write a mark with the process id, and do what the task says."""
    path = Path(task.folder) / str(task.number)
    first = not path.exists()
    if not first:
        path = path.with_name(f"{path.name} again")
        assert not path.exists()
    path.with_suffix(".part").write_text(str(os.getpid()))
    path.with_suffix(".part").rename(path)
    return globals()[task.what](task, first)


def square(task: Task, first: bool) -> int:
    return task.number**2


def wait_for_others(task: Task, first: bool) -> int:
    """Return when the tasks before it have begun."""
    until(lambda: len(marks(Path(task.folder))) == task.number)
    return task.number**2


def last_for_ever(task: Task, first: bool) -> None:
    time.sleep(DEADLINE)


def announces(task: Task, first: bool) -> bool:
    """True if this process would say that it compiles; both have begun."""
    until(lambda: len(marks(Path(task.folder))) == 2)
    return not log.announced


def killed_once(task: Task, first: bool) -> int:
    if first:
        os.kill(os.getpid(), signal.SIGKILL)
    return task.number**2


def killed(task: Task, first: bool) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def exits(task: Task, first: bool) -> None:
    os._exit(task.number)


def fails(task: Task, first: bool) -> None:
    raise ValueError(f"number {task.number}")


def process(_: Any) -> int:
    return os.getpid()


def turned(content: bytes) -> bytes:
    return content[::-1]


def nested(number: int) -> list[tuple[int, int]]:
    return list(workers.in_parallel(process, range(number), workers=2))
