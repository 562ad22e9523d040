"""The subjects of ``carom bench``: scenes of the library, their sizes, and the timed steps of a run.

A window is a range of steps. Many scenes have distinct stages: discs fall, then rest. The target of a window is the
ratio that the project aims at: the other engine's time over carom's.
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
    ``targets``: by (window, bodies); bodies 0 means any number
    """

    scene: str
    windows: tuple[Window, ...]
    energy: str = "kept"
    variant: str = ""
    options: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    settings: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    sizes: tuple[int, ...] | None = None
    size_option: str = "n"
    targets: Mapping[tuple[str, int], float] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def name(self) -> str:
        return f"{self.scene}, {self.variant}" if self.variant else self.scene

    def target(self, window: str, bodies: int) -> float | None:
        """The target ratio, or None."""
        return self.targets.get((window, bodies), self.targets.get((window, 0)))

    def build_options(self, size: int) -> dict[str, Any]:
        """The keyword arguments of the scene's build."""
        return {**self.options, self.size_option: size}


QUERIES = (("box 4 x 4", 20.0), ("disc r = 2", 20.0), ("nearest within 2", 15.0), ("ray across", 12.0))
AFTER_START = (Window("", 10, 600),)


def _fastgas(collision: str, **more: Any) -> Subject:
    settings = {} if collision == "discrete" else {"collision": collision}
    return Subject("fastgas", AFTER_START, variant=collision, settings=settings, sizes=(1000,), **more)


def _few(what: str, n: int, target: float, **options: Any) -> Subject:
    targets = {("", 0): target}
    return Subject("few", (Window("", 10, 200),), "", what, options=options, sizes=(n,), targets=targets)


def _pyramid(friction: float, target: float) -> Subject:
    return Subject(
        "pyramid",
        (Window("", 0, 500),),
        energy="left",
        variant=f"friction {friction:g}",
        options={"friction": friction},
        sizes=(50,),
        size_option="rows",
        targets={("", 0): target},
    )


SUITE: tuple[Subject, ...] = (
    _few("at rest", 20, 1.0),
    _few("bouncing", 20, 0.7, height=5.0, restitution=0.8),
    _few("flying", 20, 0.5, height=1000.0),
    _few("at rest", 200, 2.0),
    Subject("gas2d", AFTER_START, targets={("", 1000): 3.0, ("", 10_000): 6.0, ("", LARGE): 10.0}),
    Subject("mixed2d", AFTER_START, targets={("", 10_000): 6.0}),
    Subject(
        "pile2d",
        (Window("falling", 0, 300), Window("settled", 600, 900)),
        energy="left",
        targets={("falling", 1000): 2.0, ("settled", 1000): 4.0, ("falling", 10_000): 2.0, ("settled", 10_000): 8.0},
    ),
    _pyramid(0.6, 4.0),
    _pyramid(0.0, 5.0),
    Subject("static_world", AFTER_START, sizes=(1000,), targets={("", 0): 2.0}),
    _fastgas("continuous", targets={("", 0): 1 / 3}),
    _fastgas("discrete"),
    Subject("freefall", (Window("", 10, 300),), energy="", sizes=(LARGE,), targets={("", 0): 8.0}),
    Subject("player_query", (), energy="", targets={(query, 10_000): target for query, target in QUERIES}),
)


def subjects(scenes: Iterable[str] = ()) -> tuple[Subject, ...]:
    """The subjects of ``scenes`` in suite order; all if none are named. Problem for a scene that is not measured."""
    wanted = list(scenes)
    known = list(dict.fromkeys(subject.scene for subject in SUITE))
    for name in wanted:
        if name not in known:
            raise Problem(f"--scenes: {name!r} is not measured{did_you_mean(name, known)}")
    return tuple(subject for subject in SUITE if not wanted or subject.scene in wanted)


def sizes_of(subject: Subject, asked: tuple[int, ...]) -> tuple[int, ...]:
    """The sizes to measure: the subject's own, or the requested ones."""
    return subject.sizes if subject.sizes is not None else asked
