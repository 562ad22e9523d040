"""A counter of time that compiled code can read in a few nanoseconds, and what one tick of it is worth."""

from __future__ import annotations

import platform
import time
from typing import Any

from ..compilation import untimed_kernel
from .lazy import JIT, cgutils, intrinsic, ir, types

# Cycles of the processor's clock; reading them is forbidden elsewhere, where a steady counter is free for all.
_IS_X86 = platform.machine().lower() in ("x86_64", "amd64", "i686", "x86")
_COUNTER = "llvm.readcyclecounter" if _IS_X86 else "llvm.readsteadycounter"


def _emit_counter(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    kind = ir.FunctionType(ir.IntType(64), [])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, _COUNTER), [])


@intrinsic
def _compiled_ticks(typing_context: Any) -> Any:
    return types.int64(), _emit_counter


# The counter; with the JIT off nanoseconds.
read_ticks: Any = _compiled_ticks if JIT else time.perf_counter_ns


@untimed_kernel
def ticks_now() -> int:
    """The counter, for Python."""
    return read_ticks()


class TickClock:
    """Seconds per tick, from the time that has passed since this object was made."""

    SHORTEST = 2e-3  # s: below it the ratio is not exact

    def __init__(self) -> None:
        self._ticks, self._time = ticks_now(), time.perf_counter()

    @property
    def seconds_per_tick(self) -> float:
        while time.perf_counter() - self._time < self.SHORTEST:
            pass
        return (time.perf_counter() - self._time) / max(ticks_now() - self._ticks, 1)
