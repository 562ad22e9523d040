"""What is known of last step's contacts at rest: the impulses that the solver starts with."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from ...framework.compilation import kernel
from ...framework.vectors import add_scaled, dot, row, store

TURNED = 0.5  # cosine between last step's normal and this one's, below which the impulses say nothing


class ContactMemory:
    """Pairs in canonical order, with their impulses; the columns only grow.

    count; entity_a, entity_b (m,); normal (m, d); impulse (m,) of the last substep, total (m,) of the whole step;
    tangent (m, d): the friction's impulse of the last substep. ``substep`` and ``step``: seconds these belong to.
    """

    COLUMNS = (("entity_a", np.int64, False), ("entity_b", np.int64, False), ("normal", float, True))
    COLUMNS += (("impulse", float, False), ("total", float, False), ("tangent", float, True))

    def __init__(self, dimensions: int) -> None:
        self.dimensions = dimensions
        self.count = 0
        self.stamp = 0  # grows with every change
        self.step = self.substep = 1.0
        self.capacity = 0
        self.entity_a = self.entity_b = self.normal = self.impulse = self.total = self.tangent = np.empty(0)
        self.reserve(16)

    def reserve(self, count: int) -> None:
        """Room for that many; what is there is lost."""
        if count > self.capacity:
            self.capacity = max(count, 2 * self.capacity)
            for name, dtype, vector in self.COLUMNS:
                shape = (self.capacity, self.dimensions) if vector else self.capacity
                setattr(self, name, np.zeros(shape, dtype))

    def __deepcopy__(self, memo: Any) -> ContactMemory:
        made = copy.copy(self)
        for name, _, _ in self.COLUMNS:
            setattr(made, name, getattr(self, name).copy())
        return made

    def scale_to(self, step: float, substep: float) -> None:
        """The impulses that belong to other steps than these."""
        if step != self.step:
            self.total[: self.count] *= step / self.step
        if substep != self.substep:
            self.impulse[: self.count] *= substep / self.substep
            self.tangent[: self.count] *= substep / self.substep
        self.step, self.substep = step, substep


@kernel
def recall(
    a, b, slot, old_a, old_b, count, old_normal, old_impulse, old_tangent, old_first, old_second, place, normal,
    impulse, tangent, loose, like,
):  # fmt: skip
    """Start each contact with the impulses that its pair had, if its normal has not turned far; else with none.

    a, b (m,) and old_a, old_b (count,): entities, canonical order; ``slot`` (m,): where the contact's columns are.
    loose (n,) is set for bodies that a contact of the last step pushes no more: their other contacts push too much.
    Returns whether there are any. old_first, old_second: rows of those pairs; place: of rows among the bodies.
    """
    for r in range(len(a)):
        k = slot[r]
        impulse[k] = 0.0
        for axis in range(len(like)):
            tangent[k, axis] = 0.0
    any_loose = False
    r = 0
    for j in range(count):
        while r < len(a) and (a[r] < old_a[j] or (a[r] == old_a[j] and b[r] < old_b[j])):
            r += 1
        if r < len(a) and a[r] == old_a[j] and b[r] == old_b[j]:
            k = slot[r]
            n = row(normal, k, like)
            if dot(row(old_normal, j, like), n) > TURNED:
                impulse[k] = old_impulse[j]
                pull = row(old_tangent, j, like)
                store(tangent, k, add_scaled(pull, n, -dot(pull, n)))
                continue
        for side in range(2):
            i = old_first[j] if side == 0 else old_second[j]
            if i >= 0 and place[i] >= 0:
                loose[place[i]] = True
                any_loose = True
    return any_loose


@kernel
def remember(
    a, b, slot, normal, impulse, total, tangent, new_a, new_b, new_normal, new_impulse, new_total, new_tangent
):  # fmt: skip
    """Keep the contacts that pushed; returns how many."""
    count = 0
    for r in range(len(a)):
        k = slot[r]
        if total[k] <= 0.0:
            continue
        new_a[count], new_b[count] = a[r], b[r]
        new_impulse[count], new_total[count] = impulse[k], total[k]
        for axis in range(normal.shape[1]):
            new_normal[count, axis] = normal[k, axis]
            new_tangent[count, axis] = tangent[k, axis]
        count += 1
    return count
