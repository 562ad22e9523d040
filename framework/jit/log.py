"""What compiling and loading kernels costs a process, and the switch for checked builds."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass
class CompilationLog:
    """What compiling has cost this process so far; the lab reports it apart from run time."""

    compiled: list[tuple[str, float]] = field(default_factory=list)  # (kernel, seconds)
    loaded: int = 0
    waited: float = 0.0  # s, for kernels to be compiled or loaded
    listeners: list[Callable[[str], None]] = field(default_factory=list)  # told the kernel that begins to compile
    announced: bool = False
    left: int = 0  # functions to compile before a step can go on, that which compiles now included; 0: not known
    processes: int = 1  # that may compile at once, see link_all
    background: bool = os.environ.get("CAROM_BACKGROUND", "") != "0"  # whether a thread compiles ahead, see background

    @property
    def seconds(self) -> float:
        """Spent compiling."""
        return sum(seconds for _, seconds in self.compiled)


log = CompilationLog()
background = threading.local()  # active: this thread compiles ahead, no step waits for it


def in_background() -> bool:
    return getattr(background, "active", False)


CHECKED = os.environ.get("CAROM_CHECK", "") not in ("", "0")  # a build that checks every index into a record
