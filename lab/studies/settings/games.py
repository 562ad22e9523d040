"""The cheapest settings for each kind of game: a representative scene and its required accuracy.

Each scene is tuned by search (:mod:`carom.lab.tuning.search`), and the presets are measured in the same norm. If the
requirement is only that no body gets lost, which is no error that falls with the step, all candidates are tried
instead.

A game takes at least one step per frame, so no step here is longer than 1/60 s, though longer ones may be sufficient.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from ....framework import Settings, World
from ....framework.settings import SWEPT_CAP
from ...bench.results import machine
from ...cases.case import Case
from ...cli.choices import PRESETS, preset
from ...cli.usage_errors import Problem, did_you_mean
from ...engines.cost import counts_of, work_of
from ...jobs.runs import Runs, points_of
from ...measure.escape import Enclosure
from ...measure.timing import Spread
from ...reporting.progress import NO_PROGRESS, Progress
from ...trading.code_line import settings_line
from ...trading.records import Cell, Point
from ...tuning.search import search
from . import scenes as settings_scenes
from .clock import costs
from .records import TUNED, Choice, GameChoices, GamesStudy

REPEATS = 5
STEPS = tuple(1 / (60 * 2**k) for k in range(7))  # s
SEARCH, CANDIDATES = "search", "all candidates"


@dataclass(frozen=True)
class Game:
    """A kind of game.

    scene
        of the library, with ``options``; ``label`` is its name in tables
    norm, target
        the error, in ``unit``, and its upper limit; ``absolute``: the norm has a unit of the scene
    per_unit
        number of units per 1 of the norm
    timed
        timed duration of the scene, s
    also
        other errors to report, by norm, with unit and factor
    """

    name: str
    scene: str
    label: str
    needs: str
    norm: str
    target: float
    unit: str
    per_unit: float
    seconds: float
    timed: float
    absolute: bool = False
    repeats: int = 4
    options: Mapping[str, Any] = field(default_factory=dict)
    also: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    def measure(self, repeats: int, progress: Progress = NO_PROGRESS) -> GameChoices:
        """Search, and measure the presets for comparison."""
        return _tuned(self, repeats, progress)


RESIDUAL = {"speed": ("mm/s", 1000.0)}  # of a body of 1 m

GAMES: tuple[Game, ...] = (
    Game(
        "platformer", "jump", "jump", "the jump's apex, 64 px, to 0.1 px, wherever in a frame it begins", "apex", 0.1,
        "px", 1.0, 1.0, 1.0, absolute=True, repeats=16,
    ),
    Game(
        "platformer", "platforms", "60 crates", "what has landed lies, at most 1 % of a crate in each other",
        "overlap", 0.01, "%", 100.0, 6.0, 3.0,
    ),
    Game(
        "billiards", "billiards", "break of 16 balls", "1 s after the break each ball within 1 mm of its place",
        "position", 1e-3, "mm", 1000.0, 1.0, 1.0, absolute=True,
    ),
    Game(
        "particle rain", "pile2d", "300 discs into a bin", "what lies overlaps by 5 % of a grain at most, and is cheap",
        "overlap", 0.05, "%", 100.0, 8.0, 3.0, options={"n": 300},
    ),
    Game(
        "puzzle stacks", "stack", "tower of 10", "boxes sink by a thousandth into each other at most, and stand still",
        "overlap", 1e-3, "%", 100.0, 5.0, 1.0, repeats=1, also=RESIDUAL,
    ),
    Game(
        "puzzle stacks", "pyramid", "pyramid of 210", "as above, with twenty rows", "overlap", 1e-3, "%", 100.0, 3.0,
        0.5, repeats=1, options={"rows": 20}, also=RESIDUAL,
    ),
    Game(
        "orbits", "orbit", "ten turns, e = 0.6", "the energy stays within a hundredth of a percent for ten turns",
        "energy", 1e-4, "%", 100.0, settings_scenes.TEN_TURNS, 2.0, repeats=1,
    ),
)  # fmt: skip


def games_study(
    names: Sequence[str] | None = None, repeats: int = REPEATS, progress: Progress = NO_PROGRESS
) -> GamesStudy:
    """Tune each kind of game of ``names`` (None: all); repeats of timed runs. Problem for an unknown name."""
    return GamesStudy({**machine()}, [game.measure(repeats, progress) for game in of_names(names)])


def of_names(names: Sequence[str] | None) -> list[Game | Shooter]:
    """The scenes of these kinds of games; Problem for an unknown name."""
    for name in names or ():
        if name not in NAMES:
            raise Problem(f"no game {name!r}{did_you_mean(name, NAMES)}")
    return [game for game in ALL if names is None or game.name in names]


# -- by search --------------------------------------------------------------------------------------------------


def _tuned(game: Game, repeats: int, progress: Progress) -> GameChoices:
    found = search(
        game.scene, game.target, game.norm, absolute=game.absolute, seconds=game.seconds, repeats=game.repeats,
        steps=STEPS, options=game.options, workers=1, progress=progress,
    )  # fmt: skip
    runs, case = Runs(1, progress=progress), found.case
    points = {} if found.choice is None else {TUNED: found.choice}
    for name in PRESETS:
        (points[name],) = points_of(case, [Cell.of(preset(name))], runs, f"{game.label}: {name}")
    scale = game.per_unit * (found.scale if game.absolute else 1.0)
    choices = [_choice(game, name, point, found.base, scale, found.target) for name, point in points.items()]
    _time(choices, [partial(_world, case, point.cell) for point in points.values()], game.timed, repeats, progress)
    return GameChoices(
        game.name, game.label, game.needs, game.target * game.per_unit, game.unit, SEARCH,
        len({trial.cell for trial in found.trials}), choices,
    )  # fmt: skip


def _choice(game: Game, name: str, point: Point, base: Settings, scale: float, target: float) -> Choice:
    failed = point.failed or game.norm not in point.errors
    error = math.inf if failed else point.errors[game.norm].high
    also = {} if failed else {unit: factor * point.errors[norm].high for norm, (unit, factor) in game.also.items()}
    return Choice(
        name, settings_line(point.cell, base), scale * error, not failed and error <= target, point.work,
        failure=", ".join(f"{kind} in {count} of {point.repeats}" for kind, count in point.failures.items()),
        also=also,
    )  # fmt: skip


def _world(case: Case, cell: Cell) -> World:
    return case.subject.world(cell.settings(case.survey.settings))


def _time(
    choices: Sequence[Choice],
    makes: Sequence[Callable[[], World]],
    seconds: float,
    repeats: int,
    progress: Progress,
) -> None:
    """Fill in the ``milliseconds`` of these choices."""
    progress.begin(repeats)
    progress.say("timing")
    taken = []
    for repeat in costs(makes, seconds, repeats):
        taken.append(repeat)
        progress.advance(1)
    for choice, of in zip(choices, zip(*taken, strict=True), strict=True):
        choice.milliseconds = Spread.of([1e3 * cost.seconds for cost in of])


# -- by trying all candidates -----------------------------------------------------------------------------------

BULLETS = 300  # at 1,000 m/s, for half a second, walls 1 cm thick
FLIGHT = 0.5  # s
VOLLEY = 0.1  # s, of the eight shots


@dataclass(frozen=True)
class Shooter:
    """Bullets: none may get lost, and hits must be at the right place."""

    name: str = "shooter with bullets"
    label: str = f"8 shots and {BULLETS} bullets"
    needs: str = "no bullet gets through a wall, no impact is left out, each shot within 1 % of its size of its place"

    def measure(self, repeats: int, progress: Progress = NO_PROGRESS) -> GameChoices:
        """All candidates: the collision modes, shorter and shorter steps, and bullets with ``ccd``."""
        progress.begin(len(SHOOTERS))
        found: dict[str, Choice] = {}
        for name, (settings, ccd) in SHOOTERS.items():
            progress.say(f"{self.label}: {name}")
            found[name] = _shot(name, settings, ccd)
            progress.advance(1)
        shown = [*PRESETS, FINEST, CCD]
        good = [name for name in found if found[name].met and name != CCD]  # CCD is not a setting
        best = min(good, key=lambda name: found[name].work, default=None)
        chosen = [found[name] for name in shown]
        if best is not None:
            shown, chosen = [best, *shown], [dataclasses.replace(found[best], name=TUNED), *chosen]
        _time(chosen, [partial(bullets, *SHOOTERS[name]) for name in shown], FLIGHT, repeats, progress)
        return GameChoices(self.name, self.label, self.needs, 0.0, "in all", CANDIDATES, len(SHOOTERS), chosen)


CCD = "ccd=True"
FINEST = "discrete, 1/960 s"
SHOOTERS: Mapping[str, tuple[Settings, bool]] = {
    **{name: (preset(name), False) for name in PRESETS},
    **{f"discrete, 1/{rate} s": (Settings(dt=1 / rate), False) for rate in (120, 240, 480, 960)},
    "continuous": (Settings(collision="continuous"), False),
    "event-driven": (Settings(collision="event_driven"), False),
    CCD: (Settings(max_impacts_per_step=SWEPT_CAP), True),
}


def bullets(settings: Settings, ccd: bool) -> World:
    """The scene bullets of the library with fewer bodies; ccd: set for each bullet."""
    world = settings_scenes.scene_of("bullets", n=BULLETS)(settings)
    world.bodies.dynamic.ccd[:] = ccd
    return world


def _shots(settings: Settings, ccd: bool) -> World:
    world = settings_scenes.scene_of("shots")(settings)
    world.bodies.dynamic.ccd[:] = ccd
    return world


def _shot(name: str, settings: Settings, ccd: bool) -> Choice:
    wrong = int((settings_scenes.misses(partial(_shots, settings, ccd), VOLLEY) > 0.01).sum())
    with bullets(settings, ccd) as world:
        walls = Enclosure.around(world)
        for _ in range(round(FLIGHT / settings.dt)):
            world.step()
        out = walls.outside(np.array(world.bodies.dynamic.position))
        counters = world.stats().counters
        work = work_of(counts_of(world)) / FLIGHT
    figures = {"of 8 wrong": wrong, f"of {BULLETS} out": out, "impacts capped": counters.get("capped_impacts", 0)}
    error = float(sum(figures.values()))
    line = settings_line(Cell.of(settings), settings)
    return Choice(
        name, f"{line} with RigidBody({CCD})" if ccd else line, error, error == 0, work,
        also={words: float(figure) for words, figure in figures.items()},
    )  # fmt: skip


_FIRST = sum(game.name == "platformer" for game in GAMES)
ALL: tuple[Game | Shooter, ...] = (*GAMES[:_FIRST], Shooter(), *GAMES[_FIRST:])
NAMES = tuple(dict.fromkeys(game.name for game in ALL))
