"""How much Python something runs, counted: unlike seconds, the same on any machine."""

from __future__ import annotations

import gc
import sys


def calls_of(do):
    """The number of functions that ``do()`` calls, Python's own ones included."""
    count = 0

    def called(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    collecting = gc.isenabled()
    gc.disable()  # finalizers of other tests' objects would be counted
    before = sys.getprofile()
    sys.setprofile(called)
    try:
        do()
    finally:
        sys.setprofile(before)
        if collecting:
            gc.enable()
    return count
