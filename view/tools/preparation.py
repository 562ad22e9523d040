"""Compiling beside the window: what the world will need, in a thread, while the window hears keys."""

from __future__ import annotations

import threading

from ...framework import World
from ...framework.compilation import log


class Stopped(Exception):  # noqa: N818 - no error: the window was closed
    """The window has been closed; nothing more is compiled."""


class Preparation:
    """``world.prepare()`` in a thread of its own; nobody may use the world until it is :attr:`done`."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._error: BaseException | None = None
        self._stop = False
        self._kernels = 0
        self._kernel = ""
        self._thread = threading.Thread(target=self._work, name="carom preparation", daemon=True)
        self._thread.start()

    def _work(self) -> None:
        processes, log.processes = log.processes, 1  # a process with a window must not fork
        log.listeners.append(self._hear)
        try:
            self._world.prepare()
        except Stopped:
            return
        except BaseException as error:  # raised where it is waited for
            self._error = error
        finally:
            log.listeners.remove(self._hear)
            log.processes = processes

    def _hear(self, kernel: str) -> None:
        if threading.current_thread() is not self._thread:
            return
        if self._stop:
            raise Stopped
        self._kernel, self._kernels = kernel.rpartition(".")[2], max(log.left, self._kernels)

    def wait(self, seconds: float) -> bool:
        """Whether it is done after at most so many ``seconds``; raises what has failed."""
        self._thread.join(seconds)
        if self._thread.is_alive():
            return False
        if self._error is not None:
            raise self._error
        return True

    def stop(self) -> None:
        """Come to an end after the kernel that compiles now, and wait for that."""
        self._stop = True
        self._thread.join()

    @property
    def text(self) -> str:
        """What it is doing, for people."""
        if not self._kernels:
            return "loading kernels ..."
        left = max(log.left, 1)
        return f"compiling {self._kernels} kernels, {left} left: {self._kernel} ..."

    @property
    def share(self) -> float:
        """0 to 1, of the kernels that had to be compiled."""
        return 1.0 - max(log.left, 1) / self._kernels if self._kernels else 0.0
