"""Promises kept? What `carom trade` and `tune` print of a file is measured again with nothing but a world and a clock.

No code of the laboratory that measures is used. Other start phases, other seeds, another reference: one method with
steps far below those that were tried.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from ...components import AABBCollider, Transform
from ...framework import Settings, World
from ..cli.loading import import_file
from ..cli.options import budget_option
from ..reporting.text_tables import TextTable
from .page import PageOutput, shown_options

MARK = "studies promises"
FINE = {"dt": 1 / 1920, "integrator": "velocity_verlet", "collision": "event_driven", "substeps": 32}
FINE_OF_SEEDS = {"dt": 1 / 240, "collision": "continuous"}  # many runs of a costly game
PASSES = 5
PHASES = [1 - (k + 0.5) / 8 for k in range(8)]
SEEDS = range(700, 706)
UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "us": 1e-6, "ms": 1e-3, "s": 1.0}
FACTOR = 2.0
TUNED = {  # what tune is asked for
    "survivors": ("--norm", "kills", "--max-error", "0.05"),
    "platformer": ("--norm", "hero", "--max-error", "0.01"),
    "pool": ("--norm", "ball 0", "--max-error", "0.01"),
}
LENGTH = r"(less than )?([\d.e+-]+) (mm|cm|m)"


@dataclass(frozen=True)
class Kept:
    """A promise: as printed, and as measured again; chance: what the second may be off by, two standard errors."""

    file: str
    settings: str
    promise: str
    printed: float
    again: float
    chance: float = 0.0
    at_most: bool = False
    at_least: bool = False

    @property
    def factor(self) -> float:
        """The larger over the smaller."""
        if (self.at_most and self.again <= self.printed) or (self.at_least and self.again >= self.printed):
            return 1.0
        if abs(self.again - self.printed) <= self.chance:
            return 1.0
        small, large = sorted((abs(self.printed), abs(self.again)))
        return 1.0 if large == 0 else math.inf if small == 0 else large / small


@dataclass(frozen=True)
class Played:
    """A run: what the game compares at its end, the deepest overlap of boxes in its second half, and how far a body
    gets from where it was seen first."""

    values: dict[str, Any]
    sunk: float
    reach: float


class Game:
    """A file that can be played with any settings; what has been played is kept."""

    def __init__(self, path: Path) -> None:
        self.module = import_file(path)
        self.seconds = float(self.module.seconds)
        self._played: dict[Any, Played] = {}

    def play(self, settings: Settings, phase: float = 1.0, seed: int = 0) -> Played:
        """The game from its start to its end; the first step is that part of a step."""
        key = settings, phase, seed
        if key not in self._played:
            with self.module.build(settings.replace(dt=settings.dt * phase), seed=seed) as world:
                self._played[key] = _played(world, settings.dt, self.seconds, self._compared())
        return self._played[key]

    def cost(self, settings: Settings) -> float:
        """Seconds of a frame of 1/60 s, without the first step."""
        steps = max(int(self.seconds / settings.dt) - 1, 1)
        passes = []
        for _ in range(PASSES):
            with self.module.build(settings) as world:
                world.step()
                began = time.process_time()
                for _ in range(steps):
                    world.step()
                passes.append(time.process_time() - began)
        return min(passes) / (steps * settings.dt) / 60

    def _compared(self) -> Callable[[World], dict[str, Any]]:
        def places(world: World) -> dict[str, Any]:
            return {f"entity {entity}": place.position for entity, place in world.get_component(Transform)}

        return getattr(self.module, "compared", places)


def _played(world: World, dt: float, seconds: float, compared: Callable[[World], dict[str, Any]]) -> Played:
    start = dict(_places(world))
    world.step()
    world.settings = world.settings.replace(dt=dt)
    sunk, reach, every = 0.0, 0.0, max(int(seconds / dt / 400), 1)
    while seconds - world.time > 1.000001 * dt:
        world.step()
        if world.step_count % every == 0:
            reach = max(float(np.linalg.norm(place - start.setdefault(e, place))) for e, place in _places(world))
            sunk = max(sunk, deepest(world)) if world.time > seconds / 2 else 0.0
    rest = seconds - world.time
    if rest > 1e-9:
        world.settings = world.settings.replace(dt=min(rest, dt))
        world.step()
    values = {name: None if value is None else np.array(value, float) for name, value in compared(world).items()}
    return Played(values, sunk, reach)


def _places(world: World) -> list[tuple[int, Any]]:
    dynamic = world.bodies.dynamic
    return list(zip(dynamic.entity.tolist(), np.array(dynamic.position), strict=True))


def deepest(world: World) -> float:
    """The deepest overlap of any two boxes, of which one at least is no wall or floor; by their places alone."""
    if len(world.bodies) > 100:
        return 0.0
    found = world.get_components(Transform, AABBCollider)
    centre, half = (np.array([getattr(parts[k], name) for _, parts in found], float)
                    for k, name in ((0, "position"), (1, "half_extents")))  # fmt: skip
    if len(found) < 2:
        return 0.0
    depth = (half[:, None] + half[None] - np.abs(centre[:, None] - centre[None])).min(axis=2)
    np.fill_diagonal(depth, 0.0)
    moving = np.isin([entity for entity, _ in found], world.bodies.dynamic.entity)
    return float(depth[moving].max(initial=0.0))


def promises(text: str) -> Iterator[tuple[str, str, str]]:
    """(settings, "cost" or "cost of" another, words) and (settings, "error", words) of the last answer in the text."""
    if ": use Settings" not in text:
        return  # nothing was found, and nothing is promised
    answer = text[text.rindex(": use Settings") :].partition("\n\n")[0].splitlines()
    use = answer[0].split("use ", 1)[1].removesuffix(" (as it has now)")
    norm = ""
    for line in answer[1:]:
        name, _, words = line.strip().partition(" ")
        words = words.strip()
        norm = words.partition(" allowed, in ")[2] or norm
        if name in ("cheaper", "else") and "times the work, error " in words:
            other, _, words = words.partition("): ")
            yield f"{other})", "error", f"{words.partition('error ')[2]} of the 0 allowed, in {norm}"
            continue
        if name in ("cost", "error"):
            yield use, name, words
        elif name in ("now", "cheaper", "better"):
            other, _, words = words.partition("): ")
            yield f"{other})", f"cost of {use}", words.partition(" times")[0]
            yield f"{other})", "error", words.partition("noticed: ")[2]


def kept(name: str, game: Game, settings: str, what: str, words: str) -> Iterator[Kept]:
    """The promises in these words."""
    chosen = eval(settings, {"Settings": Settings})
    if what == "cost":
        number, unit = re.match(r"([\d.e+-]+) (us|ms|s)", words).groups()  # type: ignore[union-attr]
        cost = game.cost(chosen)
        yield Kept(name, settings, "us a frame", float(number) * UNITS[unit] * 1e6, 1e6 * cost)
        return
    if what.startswith("cost of "):
        other = eval(what.removeprefix("cost of "), {"Settings": Settings})
        yield Kept(name, settings, "times the cost", float(words), game.cost(chosen) / game.cost(other))
        return
    if found := re.fullmatch(r"(at least )?([\d.e+-]+) % of the .+ allowed, in (.+)", words):
        least, number, norm = found.groups()
        error = float(number) / 100, _error(game, chosen, norm)
        yield Kept(name, settings, f"{norm}: error", *error, at_least=bool(least))
        return
    for phrase in re.split(r"; (?!one game)", words):
        if found := re.match(r"(.+): ([\d.e+-]+) on average instead of ([\d.e+-]+)", phrase):
            yield from _means(name, game, settings, chosen, *found.groups())
        elif found := re.match(r"(.+): (none|some), (and|as)", phrase):
            own, here, _ = found.groups()
            there = [game.play(chosen, phase).values[own] is not None for phase in PHASES]
            again = any(there) if here == "some" else not all(there)
            yield Kept(name, settings, f"{own}: {here}", 1.0, float(again))
        elif found := re.match(r"(.+) ends " + LENGTH + " from where", phrase):
            own, less, number, unit = found.groups()
            apart = max(_apart(game, chosen, phase, own) for phase in PHASES)
            yield Kept(name, settings, f"{own}: m off", float(number) * UNITS[unit], apart, at_most=bool(less))
        elif found := re.match(r"(.+): ([\d.e+-]+)(?: instead of ([\d.e+-]+)|, as it should be)", phrase):
            own, number, _ = found.groups()
            right = float(game.play(Settings(**FINE)).values[own])
            values = [float(game.play(chosen, phase).values[own]) for phase in PHASES]
            yield Kept(name, settings, own, float(number), max(values, key=lambda value: abs(value - right)))
        elif found := re.search(LENGTH + ": how deep", phrase) or re.search("bodies sink " + LENGTH, phrase):
            less, number, unit = found.groups()
            sunk = game.play(chosen).sunk
            yield Kept(name, settings, "sinks, m", float(number) * UNITS[unit], sunk, at_most=bool(less))


def _apart(game: Game, chosen: Settings, phase: float, own: str) -> float:
    right, mine = game.play(Settings(**FINE)).values[own], game.play(chosen, phase).values[own]
    return math.inf if right is None or mine is None else float(np.linalg.norm(mine - right))


def _error(game: Game, chosen: Settings, norm: str) -> float:
    """Relative to what the norm is relative to, in the worst phase; of a mean, with two standard errors of 3 seeds."""
    if norm == "overlap":  # the boxes of these games are 1 m
        return game.play(chosen).sunk
    if norm.startswith("mean "):
        own = norm.removeprefix("mean ")
        mine, right = (
            [float(game.play(settings, seed=seed).values[own]) for seed in SEEDS]
            for settings in (chosen, Settings(**FINE_OF_SEEDS))
        )
        wrong = abs(np.mean(mine) - np.mean(right)) + 2 * np.std(mine, ddof=1) / math.sqrt(3)
        return float(wrong / np.mean(right))
    reference = game.play(Settings(**FINE))
    if np.size(reference.values[norm]) > 1:
        return max(_apart(game, chosen, phase, norm) for phase in PHASES) / reference.reach
    right = float(reference.values[norm])
    return max(abs(float(game.play(chosen, phase).values[norm]) - right) for phase in PHASES) / abs(right)


def _means(
    name: str, game: Game, settings: str, chosen: Settings, own: str, mean: str, right: str
) -> Iterator[Kept]:
    for text, printed, played in ((settings, mean, chosen), ("right", right, Settings(**FINE_OF_SEEDS))):
        values = [float(game.play(played, seed=seed).values[own]) for seed in SEEDS]
        chance = 2 * float(np.std(values, ddof=1)) * math.sqrt(1 / len(values) + 1 / 3)
        yield Kept(name, text, f"{own}, mean", float(printed), float(np.mean(values)), chance)


@dataclass
class Promises:
    """All promises of some files."""

    found: list[Kept]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"promises": [{**asdict(one), "factor": one.factor} for one in self.found]}

    def table(self) -> TextTable:
        """One row for each promise."""
        rows = [
            (one.file, one.settings, one.promise, f"{one.printed:.3g}", f"{one.again:.3g}", f"{one.factor:.2f}")
            for one in self.found
        ]
        headings = ("game", "settings", "promise", "printed", "again", "factor")
        return TextTable("What carom trade and tune print, and the same measured again", headings, rows, words=3)

    def remarks(self) -> list[str]:
        """How many hold."""
        held = sum(one.factor <= FACTOR for one in self.found)
        finite = [one.factor for one in self.found if math.isfinite(one.factor)]
        return [
            f"{held} of {len(self.found)} promises hold within a factor of {FACTOR:g}; the factors go up to "
            f"{max(finite, default=1.0):.2f}, their median is {float(np.median(finite)) if finite else 1.0:.2f}",
            f"means: {len(SEEDS)} other seeds, 1.00 where they differ by less than chance (two standard errors); "
            f"errors: {len(PHASES)} other start phases, the worst; costs: the least of {PASSES} runs",
        ]


def _printed(command: str, path: Path, budget: float, printed: Path | None) -> str:
    """What the command says of that file: now, or before."""
    if printed is not None:
        return (printed / f"{path.stem}-{command}.txt").read_text(encoding="utf-8")
    asked = TUNED.get(path.stem, ("--max-error", "0.01")) if command == "tune" else ()
    line = [sys.executable, "-m", "carom", command, str(path), "--budget", str(budget), *asked]
    return subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True).stdout


@click.command("promises", short_help="What `carom trade` promises of files, measured again by other means.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path, exists=True))
@budget_option
@click.option("--printed", type=click.Path(path_type=Path), help="A folder of FILE-trade.txt, FILE-tune.txt.")
@shown_options
def promises_command(
    files: tuple[Path, ...], budget: float, printed: Path | None, as_json: bool, as_markdown: bool, into: Path | None
) -> None:
    """Run `carom trade` and `tune` on each file, then recompute what their answers promise."""
    output = PageOutput.of(MARK, as_json, as_markdown, into, None)
    found: list[Kept] = []
    for path in files:
        game = Game(path)
        for command in ("trade", "tune"):
            for settings, what, words in promises(_printed(command, path, budget, printed)):
                for one in kept(path.stem, game, settings, what, words):
                    found.append(one)
                    click.echo(f"{path.stem}: {one.promise} {one.printed:.3g}, {one.again:.3g}", err=True)
    result = Promises(list(dict.fromkeys(found)))
    output.show(result, [result.table()], result.remarks())
