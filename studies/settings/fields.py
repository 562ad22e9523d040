"""Each field of Settings, varied alone in a scene where it matters: cost and error of its values.

Costs are compared with the default value's within each repeat. Errors are measured separately, in whole runs.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from carom.framework import Settings, World
from carom.framework.settings import COLLISION_MODES
from carom.lab import testing as kit
from carom.lab.measure.engine import counts_of, work_of
from carom.lab.trading.grid import METHODS

from ..runner import WARM_UP_STEPS, Axis, nanoseconds_per_step
from . import scenes as at

ALL_METHODS = ("explicit_euler", *METHODS)
ENOUGH = 0.03  # s of processor time per repeat: shorter runs are repeated until then


@dataclass(frozen=True)
class Varied:
    """One field and one scene.

    others: the fields other than the varied one that differ from the default
    values: the values tried; the ratios are relative to the value in ``others`` or in Settings
    errors: units by name; ``measure`` returns the errors, ``words`` describe them
    seconds: duration of the runs whose errors are measured; ``timed``: of the timed runs
    """

    field: str
    scene: str
    build: at.Build
    values: tuple[Any, ...]
    measure: Callable[[at.Make, float], at.Errors]
    errors: Mapping[str, str]
    words: str
    seconds: float
    timed: float
    others: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def base(self) -> Settings:
        """The settings with the default value."""
        return Settings().replace(**self.others)

    @property
    def default(self) -> Any:
        """The value that the ratios are relative to."""
        return getattr(self.base, self.field)

    def world(self, value: Any) -> World:
        """The scene with that value, at its start."""
        return self.build(self.base.replace(**{self.field: value}))

    def axis(self) -> Axis:
        """For the runner."""
        return Axis(self.field, self.scene, self.values, self.time, self.facts)

    def facts(self, value: Any) -> dict[str, Any]:
        """The errors by name, and ``work``: the weighted counts of a simulated second, the same on every machine."""
        return {**self.measure(partial(self.world, value), self.seconds), "work": self.work(value)}

    def work(self, value: Any) -> float:
        """Of a simulated second of the span that is timed."""
        with self.world(value) as world:
            kit.run(world, WARM_UP_STEPS)
            before = counts_of(world)
            kit.run(world, round(self.timed / world.settings.dt))
            return (work_of(counts_of(world)) - work_of(before)) / self.timed

    def time(self, value: Any, repeat: int) -> dict[str, float]:
        """Seconds per simulated second, from the start of the scene."""
        del repeat
        dt = self.base.replace(**{self.field: value}).dt
        what = f"{self.field} {value}, {self.scene}"
        taken = nanoseconds_per_step(partial(self.world, value), what, round(self.timed / dt), ENOUGH)
        return {"seconds": 1e-9 * taken / dt}


SWEPT = {"integrator": "velocity_verlet", "collision": "continuous"}
OVERLAP = {"overlap": "%", "speed": "mm/s"}
RESTS = "deepest overlap of two boxes in the second half, in % of their size; fastest box in the end; right is 0"
APEX = "height of the jump's highest point, of 64 pixels, beside v²/2g; the worst of 4 start phases"
LOST = {"outside": "% out", "missing": "% missed"}
IMPACTS_LOST = (
    "discs that end outside the walls; impacts that are missing beside a run with all impacts at their true times, "
    "of which a hundredth is chance"
)

VARIED: tuple[Varied, ...] = (
    Varied(
        "dt", "jump", at.scene_of("jump"), (1 / 30, 1 / 60, 1 / 120, 1 / 240), at.apex, {"apex": "px"},
        APEX, 1.0, 0.8,
    ),
    Varied(
        "dt", "stack of 10", at.scene_of("stack"), (1 / 30, 1 / 60, 1 / 120, 1 / 240), at.rest, OVERLAP, RESTS,
        5.0, 1.0,
    ),
    Varied(
        "dt", "fast gas", at.scene_of("fastgas"), (1 / 60, 1 / 120, 1 / 240, 1 / 960), at.lost, LOST,
        IMPACTS_LOST, 0.5, 0.5,
    ),
    Varied(
        "substeps", "stack of 10", at.scene_of("stack"), (1, 2, 4, 8, 16, 32), at.rest, OVERLAP, RESTS, 5.0, 1.0
    ),
    Varied(
        "substeps", "pyramid of 210", at.scene_of("pyramid", rows=20), (1, 2, 4, 8, 16, 32), at.rest, OVERLAP, RESTS,
        3.0, 0.5,
    ),
    Varied(
        "integrator", "jump", at.scene_of("jump"), ALL_METHODS, at.apex, {"apex": "px"},
        APEX, 1.0, 0.8,
    ),
    Varied(
        "integrator", "orbit", at.scene_of("orbit"), ALL_METHODS, at.orbit, {"energy": "%", "growth": "% in the end"},
        "largest departure of the energy in ten turns of an ellipse (e = 0.6) of 377 steps each; what of it is left in "
        "the end, with its sign",
        at.TEN_TURNS, 2.0,
    ),
    Varied(
        "collision", "shots", at.scene_of("shots"), COLLISION_MODES, at.wrong_balls, {"wrong": "of 8 balls"},
        "balls that go 4 sizes in a step and are not where they must be, by more than 1 % of their size", 0.1, 1 / 12,
    ),
    Varied(
        "collision", "fast gas", at.scene_of("fastgas"), COLLISION_MODES, at.lost, LOST, IMPACTS_LOST, 0.5, 0.5,
    ),
    Varied("collision", "slow gas", at.scene_of("gas2d"), COLLISION_MODES, at.lost, LOST, IMPACTS_LOST, 2.0, 0.5),
    Varied(
        "collision", "pyramid of 210", at.scene_of("pyramid", rows=20), COLLISION_MODES, at.rest, OVERLAP, RESTS,
        3.0, 0.5,
    ),
    *(
        Varied(
            "geometry", f"{2000:,} boxes in {thing}", partial(at.boxes_in_spheres, dimensions=dimensions),
            ("precise", "bounds"), at.false_contacts, {"false": "% false"},
            "contacts that are none among those reported, of boxes of side 1 in the smallest circles or spheres that "
            "hold them, all over the place",
            0.1, 1 / 12,
        )
        for dimensions, thing in ((2, "circles"), (3, "spheres"))
    ),
    Varied(
        "restitution_threshold", "drops", at.scene_of("drops"), (None, 0.0, 0.1, 0.5, 1.0, 2.0), at.last_bounce,
        {"lost": "mm"},
        "height of the first bounce that is not made any more, by the law of the scene: 4.9 e^(2n) m; a ball that "
        "hits the floor at the threshold v would come up by e²v²/2g",
        12.0, 2.0, SWEPT,
    ),
    Varied(
        "restitution_threshold", "platforms", at.scene_of("platforms"), (None, 0.0, 0.1, 0.5, 1.0, 2.0), at.rest,
        OVERLAP, RESTS, 6.0, 3.0,
        {"max_impacts_per_step": 32},
    ),
    Varied(
        "slop", "tiles", at.tiles, (None, 0.0, 0.001, 0.02, 0.1), at.seams,
        {"stuck": "% lost", "passed": "mm passed"},
        "speed that a box of 1 m loses at the seams of an even floor of tiles that it slides over; the "
        "highest step up that it slides over all the same, of 1, 3, 10, 30, 60 and 120 mm",
        3.0, 3.0,
    ),
    Varied("slop", "stack of 10", at.scene_of("stack"), (None, 0.0, 0.1), at.rest, OVERLAP, RESTS, 5.0, 1.0),
    Varied(
        "max_impacts_per_step", "galperin", at.scene_of("galperin"), (64, 1, 4, 8, 1000), at.counted_pi,
        {"missing": "% missed", "energy": "% energy lost"},
        "impacts that are missing of the 314 that two blocks and a wall must have, and kinetic energy that is lost; "
        "most of them fall into a few steps",
        9.0, 3.0, {"dt": 1 / 240},
    ),
    Varied(
        "max_impacts_per_step", "fast gas", at.scene_of("fastgas"), (64, 1, 4, 8, 16), at.lost, LOST, IMPACTS_LOST,
        0.5, 0.5, {"collision": "continuous"},
    ),
    Varied(
        "sleeping", "pyramid of 210", at.scene_of("pyramid", rows=20), (False, True), at.rest, OVERLAP, RESTS, 5.0, 5.0
    ),
)  # fmt: skip


def axes(quick: bool = False, long: bool = False) -> list[Axis]:
    """All of them."""
    del quick, long
    return [varied.axis() for varied in VARIED]
