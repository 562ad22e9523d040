"""What is timed: scenes of the library, their sizes, and the steps of a run that count."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from carom import scenes
from carom.framework import Settings, World

QUICK, SIZES, LARGE = (1000,), (1000, 10_000), 100_000
ESCAPED, SINKS, GAP = "escaped", "sinks", "gap"  # figures of quality that say most of a case
FALLING = {"falling": (0, 300), "settled": (600, 900)}


@dataclass(frozen=True, eq=False)
class Case:
    """One scene at one size. windows: by name the first step that is timed, and the one after the last; without any,
    queries are timed. watch: what to look at in the end; bodies that may escape must keep their energy, too."""

    scene: str
    variant: str
    size: int
    options: Mapping[str, Any]
    settings: Settings
    windows: Mapping[str, tuple[int, int]]
    watch: str

    def __str__(self) -> str:
        return f"{self.scene} {self.size:,} {self.variant}".strip()

    def build(self, settings: Settings | None = None, seed: int = 0) -> World:
        """The scene's world, with the settings of the case if none are given."""
        function: Any = scenes.get(self.scene).build  # scenes take more keywords than their protocol promises
        return function(settings or self.settings, seed, **self.options)


def _case(
    scene: str, size: int, first: int, last: int, watch: str = "", variant: str = "", collision: str = "discrete",
    **options: Any,
) -> Case:  # fmt: skip
    return Case(scene, variant, size, options, Settings(collision=collision), {"": (first, last)}, watch)


def cases(sizes: tuple[int, ...] = SIZES, large: int = LARGE) -> list[Case]:
    """All that is timed; sizes: of the scenes that come in any; large: of two with little to do."""
    return [
        _case("few", 20, 10, 200, variant="at rest", n=20),
        _case("few", 20, 10, 200, variant="bouncing", n=20, height=5.0, restitution=0.8),
        _case("few", 20, 10, 200, variant="flying", n=20, height=1000.0),
        _case("few", 200, 10, 200, variant="at rest", n=200),
        *(_case("gas2d", n, 10, 600, ESCAPED, n=n) for n in dict.fromkeys((*sizes, large))),
        *(_case("mixed2d", n, 10, 600, ESCAPED, n=n) for n in sizes),
        *(Case("pile2d", "", n, {"n": n}, Settings(), FALLING, "") for n in sizes),
        _case("pyramid", 1275, 0, 500, SINKS, "friction 0.6", rows=50, friction=0.6),
        _case("pyramid", 1275, 0, 500, SINKS, "friction 0", rows=50, friction=0.0),
        _case("pyramid", 1275, 0, 500, SINKS, "turning", rows=50, spins=True),
        _case("dominoes", 500, 0, 500, n=500),
        _case("tumbler", 1000, 60, 360, n=1000),
        Case("rubble", "", 1000, {"n": 1000}, Settings(), FALLING, ""),
        _case("bridge", 100, 60, 360, GAP, n=100),
        _case("bridge", 200, 60, 360, GAP, "a chain", n=200, crates=0),
        _case("ragdoll", 1000, 0, 300, GAP, "on stairs", n=100),
        _case("car", 3, 0, 540),
        _case("static_world", 1000, 10, 600, ESCAPED, n=1000),
        _case("fastgas", 1000, 10, 600, ESCAPED, "continuous", "continuous", n=1000),
        _case("fastgas", 1000, 10, 600, ESCAPED, "discrete", n=1000),
        _case("freefall", large, 10, 300, n=large),
        *(Case("player_query", "", n, {"n": n}, Settings(), {}, "") for n in sizes),
    ]
