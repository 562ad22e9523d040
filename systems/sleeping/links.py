"""What cannot be moved and bears islands that sleep: they wake where it changes or goes."""

from __future__ import annotations

import numpy as np

from ...framework.jit.records.record import Record
from .stages import FALLING_ASLEEP


def links_with_falling(state: Record, links: np.ndarray) -> np.ndarray:
    """(k, 2) ids of what cannot be moved, each with an island that stands on it: those known, and those of what falls
    asleep."""
    bodies, pairs, joints, dynamic = state.bodies, state.pairs, state.solver.joints, state.dynamic
    near = pairs.near_contact[: pairs.count] & pairs.is_solid[: pairs.count]
    held = joints.order[: joints.active]
    a = np.concatenate((pairs.a[: pairs.count][near], joints.row_a[held]))
    b = np.concatenate((pairs.b[: pairs.count][near], joints.row_b[held]))
    fixed, body = np.maximum(a, b), np.minimum(a, b)
    some = (fixed >= dynamic) & (body >= 0) & (body < dynamic)
    fixed, body = fixed[some], body[some]
    due = bodies.sleep_state[body] == FALLING_ASLEEP
    found = np.stack((bodies.entity[fixed[due]], bodies.island[body[due]]), axis=1)
    links = np.concatenate((links, found))
    links = links[np.lexsort((links[:, 1], links[:, 0]))]
    return links[np.append(True, (links[1:] != links[:-1]).any(axis=1))[: len(links)]]
