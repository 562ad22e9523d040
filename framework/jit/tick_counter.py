"""A counter of time that compiled code can read in a few nanoseconds, and what one tick of it is worth."""

from __future__ import annotations

import platform
import time
from typing import Any

from ..compilation import untimed_kernel
from .lazy import JIT, cgutils, intrinsic, ir, types

_HAS_CYCLES = platform.machine().lower() in ("x86_64", "amd64", "i686", "x86")  # elsewhere reading it may be forbidden
_MONOTONIC = 1


def _emit_cycles(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    kind = ir.FunctionType(ir.IntType(64), [])
    function = cgutils.get_or_insert_function(builder.module, kind, "llvm.readcyclecounter")
    return builder.call(function, [])


def _emit_clock(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    word = ir.IntType(64)
    pair = ir.LiteralStructType((word, word))
    kind = ir.FunctionType(ir.IntType(32), [ir.IntType(32), pair.as_pointer()])
    function = cgutils.get_or_insert_function(builder.module, kind, "clock_gettime")
    moment = cgutils.alloca_once(builder, pair)
    builder.call(function, [ir.IntType(32)(_MONOTONIC), moment])
    seconds, rest = (builder.load(cgutils.gep_inbounds(builder, moment, 0, k)) for k in range(2))
    return builder.add(builder.mul(seconds, word(1_000_000_000)), rest)


@intrinsic
def _compiled_ticks(typing_context: Any) -> Any:
    return types.int64(), _emit_cycles if _HAS_CYCLES else _emit_clock


# The counter: cycles of the processor's clock, else nanoseconds.
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
