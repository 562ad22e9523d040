"""What kernels and functions called by address have in common: one signature, by which they are found or compiled."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from . import libraries
from .kinds import Signature
from .names import symbol_of


class Linkable:
    """A function of one signature, out of a library or compiled.

    py_func: the plain function; signature: None if it is compiled for whatever it is called with.
    """

    py_func: Any
    signature: Signature | None
    ready = False  # it has been linked

    @cached_property
    def symbol(self) -> str:
        """Its name in libraries; none of what is compiled for whatever it is called with."""
        return "" if self.signature is None else symbol_of(self.py_func, self.signature)

    @property
    def holder(self) -> libraries.Library | None:
        """The library that has it."""
        return libraries.holder(self.symbol, self.py_func)

    @property
    def compiled(self) -> Any:
        """numba's dispatcher that compiles it; LibraryError where there is no compiler."""
        raise NotImplementedError

    @property
    def is_cached(self) -> bool:
        """Whether linking it compiles nothing."""
        return self.ready or self.holder is not None or self.compiled.is_kept(self.signature)

    @property
    def dependency_count(self) -> int:
        """Of how many functions it is made: the more, the longer it takes to compile."""
        return self.compiled.dependency_count

    def link(self) -> None:
        """Compile or load it now."""
        raise NotImplementedError
