"""The scene protocol: a function that builds a world, and the data needed to describe and draw it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ..framework import Settings, World

USUAL = Settings()


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
    settings: Settings = USUAL

    @property
    def dimensions(self) -> int:
        return len(self.view[0])
