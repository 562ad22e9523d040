"""The scene protocol: a module with a function that builds a world, and the data needed to describe and draw it."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import ModuleType
from typing import Protocol, Self

from ..framework import Settings, World


class Build(Protocol):
    """``build(settings, seed=0) -> World``: the same settings and seed give the same world, bit for bit."""

    def __call__(self, settings: Settings | None = None, seed: int = 0) -> World: ...


@dataclass(frozen=True)
class Scene:
    """One scene of the library.

    ``seconds`` is the recommended simulated time; ``view`` is the part of space to draw, as its lower and upper
    corner (one number per dimension each); ``settings`` are those that ``build(None)`` takes.
    """

    name: str
    description: str
    build: Build
    seconds: float
    view: tuple[tuple[float, ...], tuple[float, ...]]
    settings: Settings = field(default_factory=Settings)

    @classmethod
    def of(cls, module: ModuleType) -> Self:
        """The scene of a module: the first line of its docstring, its build, SECONDS, VIEW and, if any, SETTINGS."""
        name, description = module.__name__.rpartition(".")[2], (module.__doc__ or "").partition("\n")[0]
        settings = getattr(module, "SETTINGS", Settings())
        return cls(name, description.removesuffix("."), module.build, module.SECONDS, module.VIEW, settings)

    @property
    def dimensions(self) -> int:
        return len(self.view[0])
