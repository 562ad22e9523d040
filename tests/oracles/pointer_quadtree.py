"""A textbook quadtree with pointers: split until a node holds one body, descend only where boxes touch.

Simple and slow on purpose; the oracle for the implicit tree. Works in any dimension (2^d children per node).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

DEPTH_CAP = 24  # coincident bodies would be split without end


@dataclass
class Node:
    lower: np.ndarray
    upper: np.ndarray
    depth: int
    bodies: list[int] = field(default_factory=list)
    children: list[Node] = field(default_factory=list)


class PointerQuadtree:
    """Every body is in all leaves its closed box touches; finite boxes only."""

    def __init__(self, lower: np.ndarray, upper: np.ndarray) -> None:
        self.lower, self.upper = lower, upper
        self.root = Node(lower.min(axis=0), upper.max(axis=0), 0) if len(lower) else None
        for body in range(len(lower)):
            self._insert(self.root, body)

    def query(self, lower: np.ndarray, upper: np.ndarray) -> set[int]:
        found: set[int] = set()
        self._collect(self.root, lower, upper, found)
        return found

    def pairs(self) -> set[tuple[int, int]]:
        boxes = zip(self.lower, self.upper, strict=True)
        return {(i, j) for i, (lower, upper) in enumerate(boxes) for j in self.query(lower, upper) if i < j}

    def _insert(self, node: Node, body: int) -> None:
        if not touching(self.lower[body], self.upper[body], node.lower, node.upper):
            return
        if node.children:
            for child in node.children:
                self._insert(child, body)
            return
        node.bodies.append(body)
        if len(node.bodies) > 1 and node.depth < DEPTH_CAP and self._worth_splitting(node):
            self._split(node)

    def _worth_splitting(self, node: Node) -> bool:
        """Bodies larger than half the node would only be copied into every child."""
        half = 0.5 * (node.upper - node.lower)
        return all(np.all(self.upper[b] - self.lower[b] < half) for b in node.bodies)

    def _split(self, node: Node) -> None:
        middle = 0.5 * (node.lower + node.upper)
        for corner in np.ndindex(*(2,) * len(middle)):
            high = np.array(corner, bool)
            lower, upper = np.where(high, middle, node.lower), np.where(high, node.upper, middle)
            node.children.append(Node(lower, upper, node.depth + 1))
        bodies, node.bodies = node.bodies, []
        for body in bodies:
            for child in node.children:
                self._insert(child, body)

    def _collect(self, node: Node | None, lower: np.ndarray, upper: np.ndarray, found: set[int]) -> None:
        if node is None or not touching(lower, upper, node.lower, node.upper):
            return
        found.update(b for b in node.bodies if touching(lower, upper, self.lower[b], self.upper[b]))
        for child in node.children:
            self._collect(child, lower, upper, found)


def touching(lower_a: np.ndarray, upper_a: np.ndarray, lower_b: np.ndarray, upper_b: np.ndarray) -> bool:
    """Closed boxes: sharing one point is enough."""
    return bool(np.all(lower_a <= upper_b) and np.all(lower_b <= upper_a))
