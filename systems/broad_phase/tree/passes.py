"""The tree's kernels as Python calls them: ``(tree, other) -> code``, linked, by the addresses of two records."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, cached_property
from typing import Any

from ....framework.compilation import kernel
from ....framework.jit.kinds import INT, record_kind
from ....framework.jit.linkable import Linkable
from ....framework.jit.linking import Linked, linked_call
from ....framework.jit.records.record_type import record_at
from ..records import TREE
from . import build, pairs

BUILDING: tuple[Callable[..., Any], ...] = (
    build.build_one_cell, build.build_tree, build.assign_again, build.finish_tree,
)  # fmt: skip
PAIR_FUNCTIONS: tuple[Callable[..., Any], ...] = (
    pairs.find_ranges_within, pairs.find_ranges_between, pairs.test_within, pairs.test_between,
)  # fmt: skip
TREE_FUNCTIONS = (*BUILDING, *PAIR_FUNCTIONS)


class TreePasses:
    """The passes of trees of one dimension; each compiles, or is loaded, when first run."""

    def __init__(self, dimensions: int) -> None:
        kind = record_kind(TREE, dimensions)
        self._signature = INT(kind, kind)
        self._at = record_at(TREE, dimensions)
        self.linked = {function.__name__: Linked(function, self._signature) for function in TREE_FUNCTIONS}

    @cached_property
    def _call(self) -> Any:
        at, call = self._at, linked_call(lambda: self._signature)

        @kernel
        def run_tree_pass(function: int, tree: int, other: int) -> int:
            return call(function, at(tree), at(other))

        return run_tree_pass

    def of_world(self, has_shapes: bool) -> Iterator[Linkable]:
        """The passes that a world may run; without shapes there are no pairs, only trees for queries."""
        yield self._call
        for function in (*BUILDING, *(PAIR_FUNCTIONS if has_shapes else ())):
            yield self.linked[function.__name__]

    def run(self, name: str, tree: Any, other: Any = None) -> int:
        """Run a pass over the records of a tree, or of two."""
        return self._call(self.linked[name].address, tree.address, (tree if other is None else other).address)


@cache
def tree_passes(dimensions: int) -> TreePasses:
    """The passes for worlds of that many dimensions."""
    return TreePasses(dimensions)
