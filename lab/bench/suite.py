"""The subjects of ``carom bench``: scenes of the library, their sizes, and the timed steps of a run.

A window is a range of steps. Many scenes have distinct stages: discs fall, then rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from ..cli.usage_errors import Problem, did_you_mean

SIZES = (1000, 10_000)
LARGE = 100_000
MOST_BODY_STEPS = 10_000_000  # limit per window: with more bodies fewer steps are timed


@dataclass(frozen=True)
class Window:
    """Steps ``first`` to ``last`` (exclusive) of a run; ``name`` is empty where there is only one."""

    name: str
    first: int
    last: int

    def shortened(self, bodies: int) -> Window:
        """The same start, with the number of steps limited for this number of bodies."""
        return Window(self.name, self.first, min(self.last, self.first + max(60, MOST_BODY_STEPS // bodies)))


@dataclass(frozen=True)
class Subject:
    """One measured scene.

    ``variant``: distinguishes two subjects of one scene; ``options`` are passed to the scene's build
    ``settings``: carom settings that differ from the default
    ``windows``: the timed steps; empty if queries are timed instead
    ``sizes``: the numbers of bodies, if they differ from the requested ones
    ``energy``: "kept": kinetic energy must be conserved, shown as a percentage; "left": it must be dissipated, shown in
    joules; "": neither
    ``quick``: it is part of a quick comparison
    """

    scene: str
    windows: tuple[Window, ...]
    energy: str = "kept"
    variant: str = ""
    options: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    settings: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    sizes: tuple[int, ...] | None = None
    size_option: str = "n"
    quick: bool = True

    @property
    def name(self) -> str:
        return f"{self.scene}, {self.variant}" if self.variant else self.scene

    def build_options(self, size: int) -> dict[str, Any]:
        """The keyword arguments of the scene's build."""
        return {**self.options, self.size_option: size}


AFTER_START = (Window("", 10, 600),)


def _few(what: str, n: int, **options: Any) -> Subject:
    return Subject("few", (Window("", 10, 200),), "", what, options=options, sizes=(n,))


def _pyramid(variant: str, quick: bool = True, **options: Any) -> Subject:
    windows = (Window("", 0, 500),)
    return Subject("pyramid", windows, "left", variant, options, sizes=(50,), size_option="rows", quick=quick)


SUITE: tuple[Subject, ...] = (
    _few("at rest", 20),
    _few("bouncing", 20, height=5.0, restitution=0.8),
    _few("flying", 20, height=1000.0),
    _few("at rest", 200),
    Subject("gas2d", AFTER_START),
    Subject("mixed2d", AFTER_START),
    Subject("pile2d", (Window("falling", 0, 300), Window("settled", 600, 900)), energy="left"),
    _pyramid("friction 0.6", friction=0.6),
    _pyramid("friction 0", friction=0.0),
    _pyramid("turning", quick=False, spins=True),
    Subject("dominoes", (Window("", 0, 500),), "left", sizes=(500,)),
    Subject("tumbler", (Window("", 60, 360),), "left", sizes=(1000,), quick=False),
    Subject("rubble", (Window("falling", 0, 300), Window("settled", 600, 900)), "left", sizes=(1000,), quick=False),
    Subject("bridge", (Window("", 60, 360),), "left", sizes=(100,), quick=False),
    Subject("bridge", (Window("", 60, 360),), "left", "a chain", {"crates": 0}, sizes=(200,), quick=False),
    Subject("ragdoll", (Window("", 0, 300),), "left", sizes=(100,), quick=False),
    Subject("static_world", AFTER_START, sizes=(1000,)),
    Subject("fastgas", AFTER_START, variant="continuous", settings={"collision": "continuous"}, sizes=(1000,)),
    Subject("fastgas", AFTER_START, variant="discrete", sizes=(1000,)),
    Subject("freefall", (Window("", 10, 300),), energy="", sizes=(LARGE,)),
    Subject("player_query", (), energy=""),
)


def subjects(scenes: Iterable[str] = (), quick: bool = False) -> tuple[Subject, ...]:
    """The subjects of ``scenes`` in suite order; if none are named, all, or all ``quick`` ones. Problem for a scene
    that is not measured."""
    wanted = list(scenes)
    known = list(dict.fromkeys(subject.scene for subject in SUITE))
    for name in wanted:
        if name not in known:
            raise Problem(f"--scenes: {name!r} is not measured{did_you_mean(name, known)}")
    if not wanted:
        return tuple(subject for subject in SUITE if subject.quick or not quick)
    return tuple(subject for subject in SUITE if subject.scene in wanted)


def sizes_of(subject: Subject, asked: tuple[int, ...]) -> tuple[int, ...]:
    """The sizes to measure: the subject's own, or the requested ones."""
    return subject.sizes if subject.sizes is not None else asked
