"""A binary heap of events to come, the earliest on top, in arrays that never grow by what has been taken off.

heap (m,) is a permutation of the events' places: the first ones are a heap, all behind them are free.
"""

from __future__ import annotations

from ...framework.compilation import inlined, part


@inlined
def earlier(i, j, times, keys):
    """Order of events: time, then the pair's place in the canonical order."""
    return times[i] < times[j] or (times[i] == times[j] and keys[i] < keys[j])


@part
def heap_push(heap, size, times, keys):
    """Add the event in place heap[size], which was free; returns the new size."""
    child = size
    while child > 0:
        parent = (child - 1) // 2
        if not earlier(heap[child], heap[parent], times, keys):
            break
        heap[child], heap[parent] = heap[parent], heap[child]
        child = parent
    return size + 1


@part
def heap_pop(heap, size, times, keys):
    """Take the earliest event off the top: it is in place heap[size - 1], free again; returns the new size."""
    size -= 1
    heap[0], heap[size] = heap[size], heap[0]
    parent = 0
    while True:
        child = 2 * parent + 1
        if child >= size:
            return size
        if child + 1 < size and earlier(heap[child + 1], heap[child], times, keys):
            child += 1
        if not earlier(heap[child], heap[parent], times, keys):
            return size
        heap[child], heap[parent] = heap[parent], heap[child]
        parent = child
