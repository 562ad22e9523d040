"""A binary heap of events to come, the earliest on top, in arrays that never grow by what has been taken off.

``impacts.heap`` is a permutation of the events' places: the first ones are a heap, all behind them are free.
"""

from __future__ import annotations

from ...framework.compilation import inlined, part


@inlined
def earlier(impacts, i, j):
    """Order of events: time, then the pair's place in the canonical order."""
    times, keys = impacts.event_time, impacts.event_key
    return times[i] < times[j] or (times[i] == times[j] and keys[i] < keys[j])


@part
def is_current(state, event):
    """Whether neither body has had an impact since the event was made."""
    impacts, pairs, count = state.impacts, state.pairs, state.bodies.impact_count
    c = impacts.event_pair[event]
    return impacts.event_count_a[event] == count[pairs.a[c]] and impacts.event_count_b[event] == count[pairs.b[c]]


@part
def heap_push(impacts, place):
    """Add the event in that place of ``heap``, which is free: at ``waiting`` or behind it."""
    heap, child = impacts.heap, impacts.waiting
    heap[place], heap[child] = heap[child], heap[place]
    while child > 0:
        parent = (child - 1) // 2
        if not earlier(impacts, heap[child], heap[parent]):
            break
        heap[child], heap[parent] = heap[parent], heap[child]
        child = parent
    impacts.waiting += 1


@part
def heap_pop(impacts):
    """Take the earliest event off the top: it is in place heap[waiting], free again."""
    heap, size = impacts.heap, impacts.waiting - 1
    impacts.waiting = size
    heap[0], heap[size] = heap[size], heap[0]
    parent = 0
    while True:
        child = 2 * parent + 1
        if child >= size:
            return
        if child + 1 < size and earlier(impacts, heap[child + 1], heap[child]):
            child += 1
        if not earlier(impacts, heap[child], heap[parent]):
            return
        heap[child], heap[parent] = heap[parent], heap[child]
        parent = child
