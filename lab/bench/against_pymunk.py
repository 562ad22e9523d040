"""carom against pymunk on the same bodies, in one process.

Both engines start from the same world and take the same steps, one each by turns, so that background load affects both
equally. Each repeat runs every scene once, with another seed: timing one state repeatedly would train the branch
predictor and give times that are too short. The time of a repeat is the median of its steps, the result the ratio of
these within a repeat. Reading states, measuring quality, building and compiling happen between the timed steps.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from ... import scenes
from ...framework import Phase, Settings, System, World
from ...framework.compilation import log
from ...scenes import gas, player_query
from ..cli.usage_errors import Problem
from ..engines.pymunk_space import INDEXES, PymunkSpace
from ..measure.body_shapes import Enclosure, Floats, dynamic_by_id, overlaps_of, shapes_of
from ..measure.run import plain_settings
from ..measure.timing import Spread, no_garbage_collection, timed
from ..reporting.progress import NO_PROGRESS, Progress
from .by_id import inertia_by_id, moving_rows, turns_by_id
from .report import Result, Row, machine
from .suite import Subject, Window, sizes_of

CAROM = "carom"
LOOKS = 10  # at the quality of the states, per window
INSTANT = 1e-9  # s
REHEARSAL_SEED, REHEARSAL_STEPS = 1000, 30  # of the untimed run before the first repeat, which compiles the kernels


class CaromWorld:
    """A world of carom, stepped and read as a PymunkSpace is."""

    def __init__(self, world: World) -> None:
        self.world = world

    def step(self, count: int) -> None:
        """Take ``count`` steps."""
        step = self.world.step
        for _ in range(count):
            step()

    def state(self) -> tuple[Floats, Floats]:
        """Positions and velocities of the dynamic bodies, (n, 2) each, ascending by entity id."""
        return dynamic_by_id(self.world)[:2]

    def turns(self) -> tuple[Floats, Floats]:
        """Angles and angular velocities of these, (n,) each; then those of the kinematic bodies."""
        return turns_by_id(self.world)


Engines = dict[str, CaromWorld | PymunkSpace]


@dataclass
class Case:
    """A subject at one size with its results.

    ``found``: by window (or query) and engine, for each repeat the median of the times, in ms, and the
    figures of quality.
    """

    subject: Subject
    size: int
    bodies: int = 0
    timed: dict[str, int] = field(default_factory=dict)
    found: dict[str, dict[str, list[tuple[float, dict[str, float]]]]] = field(default_factory=dict)
    peer: str | None = None
    compile_seconds: float = 0.0

    def note(self, window: str, engine: str, seconds: list[float], figures: dict[str, float]) -> None:
        """Record the result of one repeat for one engine."""
        self.found.setdefault(window, {}).setdefault(engine, []).append((1e3 * float(np.median(seconds)), figures))

    def build(self, seed: int, settings: Settings | None = None) -> World:
        """The scene's world, with the subject's settings if none are given."""
        function: Any = scenes.get(self.subject.scene).build  # scenes take more keywords than their protocol promises
        settings = settings or Settings(**self.subject.settings)
        return function(settings, seed, **self.subject.build_options(self.size))


def bench(
    subjects: Iterable[Subject], sizes: tuple[int, ...], repeats: int = 5, peer: bool = True,
    progress: Progress = NO_PROGRESS,
) -> Result:  # fmt: skip
    """Measure every subject at every size, ``repeats`` times; with ``peer=False`` only carom."""
    cases = [Case(subject, size) for subject in subjects for size in sizes_of(subject, sizes)]
    progress.begin(len(cases) * repeats)
    for repeat in range(repeats):
        for case in cases:
            progress.say(f"{case.subject.name} {case.size:,}, repeat {repeat + 1} of {repeats}")
            _run(case, repeat, peer)
            progress.advance(1)
    settings = {CAROM: {}, **({"pymunk": {}} if peer else {})}
    if cases:
        with contextlib.closing(cases[0].build(0, Settings())) as world:
            settings[CAROM] = plain_settings(world)
            if peer:
                settings["pymunk"] = PymunkSpace(world).settings()
    return Result(machine(), settings, repeats, [row for case in cases for row in _rows(case)])


def _run(case: Case, repeat: int, peer: bool) -> None:
    """One repeat of one case, by all engines."""
    waited = log.waited
    if repeat == 0:
        with contextlib.closing(case.build(REHEARSAL_SEED)) as rehearsal:
            CaromWorld(rehearsal).step(REHEARSAL_STEPS)
            if peer:
                PymunkSpace(rehearsal).step(REHEARSAL_STEPS)
    with contextlib.closing(case.build(repeat)) as world:
        engines: Engines = {CAROM: CaromWorld(world)}
        case.bodies = len(world.bodies.dynamic)
        indexes = [] if not peer else [case.peer] if case.peer else list(INDEXES)
        if shapes_of(world).static.all():  # nothing to search for
            indexes = indexes[:1]
        for index in indexes:
            engines[index] = PymunkSpace(world, index)
        if case.subject.windows:
            with contextlib.closing(case.build(repeat)) as other:
                _run_windows(case, other, engines)
        else:
            for query, answers in time_queries(world, engines, case.bodies, repeat).items():
                case.timed[query] = Query.COUNT
                for name, (seconds, figures) in answers.items():
                    case.note(query, name, seconds, figures)
    if peer and case.peer is None:
        case.peer = min(indexes, key=lambda index: sum(by_engine[index][0][0] for by_engine in case.found.values()))
    case.compile_seconds += log.waited - waited


def _run_windows(case: Case, other: World, engines: Engines) -> None:
    """other: a world like carom's, in which overlaps are measured."""
    quality = {name: Quality(other) for name in engines}
    taken = 0
    for window in case.subject.windows:
        window = window.shortened(case.bodies)
        with no_garbage_collection():
            for engine in engines.values():
                engine.step(window.first - taken)
        seconds = _run_window(case, window, engines, quality)
        case.timed[window.name] = window.last - window.first
        for name, engine in engines.items():
            case.note(window.name, name, seconds[name], quality[name].figures(*engine.state(), engine.turns()[1]))
        taken = window.last


def _run_window(case: Case, window: Window, engines: Engines, quality: dict[str, Quality]) -> dict[str, list[float]]:
    """Seconds of each step, by engine; of steps in which a kernel came, none."""
    for seen in quality.values():
        seen.begin()
    names, seconds = list(engines), {name: [] for name in engines}
    ends = np.linspace(window.first, window.last, min(LOOKS, window.last - window.first) + 1).astype(int)
    for first, last in pairwise(ends.tolist()):
        with no_garbage_collection():
            for step in range(first, last):
                turn, taken = step % len(names), {}
                for name in names[turn:] + names[:turn]:
                    taken[name] = timed(partial(engines[name].step, 1))
                if all(undisturbed for _, undisturbed, _ in taken.values()):
                    for name in names:
                        seconds[name].append(taken[name][0])
        for name, engine in engines.items():
            quality[name].sample(engine.state()[0], engine.turns()[0])
    if not seconds[CAROM]:
        raise Problem(f"{case.subject.name}: kernels were compiled in all steps; run it once more")
    return seconds


def _rows(case: Case) -> list[Row]:
    subject, rows = case.subject, []
    unit = "step" if subject.windows else f"{Query.COUNT:,} queries"
    for window, by_engine in case.found.items():
        own, figures = zip(*by_engine[CAROM], strict=True)
        row = Row(
            subject.scene, subject.variant, case.bodies, window, unit, case.timed[window], subject.energy,
            Spread.of(own), compile_seconds=case.compile_seconds, settings=dict(subject.settings),
        )  # fmt: skip
        row.quality[CAROM] = _together(figures)
        if case.peer is not None:
            others, figures = zip(*by_engine[case.peer], strict=True)
            row.peer_index, row.peer_ms = case.peer, Spread.of(others)
            row.ratio = Spread.of([theirs / ours for theirs, ours in zip(others, own, strict=True)])
            row.quality["pymunk"] = _together(figures)
        rows.append(row)
    return rows


def _together(figures: Sequence[dict[str, float]]) -> dict[str, float]:
    """Combine the repeats: the maximum of error figures, the mean of the others."""
    worst = ("overlap_max", "escaped", "drift", "sink", "creep")
    return {name: float((max if name in worst else np.mean)([one[name] for one in figures])) for name in figures[0]}


# -- queries ---------------------------------------------------------------------------------------------


ROUNDS = 5  # of 1,000 queries each, at different places; the engines alternate
BOX_SIDE, REACH = 4.0, 2.0  # m
EDGE = 0.02  # m from the wall: the discs at rest start farther away


@dataclass(frozen=True)
class Query:
    """One kind of query: ``own`` runs it on a World, ``peer`` on a PymunkSpace, at places (m, 2) in a box of that side.

    Both return one number over all results, which must agree between the engines; ``figure`` is its name.
    """

    COUNT: ClassVar[int] = player_query.QUERIES
    name: str
    figure: str
    own: Callable[[World, Floats, float], float]
    peer: Callable[[Any, Floats, float], float]


def _rays(places: Floats, side: float) -> tuple[Floats, Floats]:
    """Rays from one side of the box to the other at the heights of the places; both ends (m, 2), outside all discs."""
    ends = np.full((2, *places.shape), EDGE)
    ends[:, :, 1] = places.T
    ends[1, :, 0] = side - EDGE
    return ends[0], ends[1]


def _own_rays(world: World, places: Floats, side: float) -> float:
    starts, ends = _rays(places, side)
    ways = ends - starts
    return float(np.mean(world.ray_casts(starts, ways, np.linalg.norm(ways, axis=1)).fraction))


QUERIES = (
    Query(
        "box 4 x 4", "hits",
        lambda world, places, _: len(world.query_aabbs(places - BOX_SIDE / 2, places + BOX_SIDE / 2).entities),
        lambda space, places, _: space.boxes(places - BOX_SIDE / 2, places + BOX_SIDE / 2),
    ),
    Query(
        "disc r = 2", "hits",
        lambda world, places, _: len(world.query_spheres(places, REACH).entities),
        lambda space, places, _: space.spheres(places, REACH),
    ),
    Query(
        "nearest within 2", "mean distance",
        lambda world, places, _: float(np.mean(world.query_nearests(places, max_distances=REACH).distance)),
        lambda space, places, _: float(np.mean(space.nearest(places, REACH))),
    ),
    Query(
        "ray across", "share of the way", _own_rays,
        lambda space, places, side: float(np.mean(space.rays(*_rays(places, side)))),
    ),
)  # fmt: skip


def time_queries(
    world: World, engines: dict[str, Any], bodies: int, seed: int
) -> dict[str, dict[str, tuple[list[float], dict[str, float]]]]:
    """By query and engine: seconds per 1,000 in each round, and the figure of the results, a mean over the rounds.

    ``engines``: "carom" and pymunk spaces. Each round follows a step of all engines, as in a game, so the time includes
    what carom builds for the first query after a step; pymunk has built its tree in the step.
    """
    side = gas.side(bodies, 2)
    return {query.name: _time_query(query, world, engines, bodies, side, seed) for query in QUERIES}


def _time_query(
    query: Query, world: World, engines: dict[str, Any], bodies: int, side: float, seed: int
) -> dict[str, tuple[list[float], dict[str, float]]]:
    names = list(engines)
    seconds, figures = {name: [] for name in names}, dict.fromkeys(names, 0.0)
    for number in range(ROUNDS + 1):  # the first round compiles and is not counted
        places = player_query.places(bodies, Query.COUNT, seed * (ROUNDS + 1) + number)
        for engine in engines.values():
            engine.step(1)
        turn = number % len(names)
        for name in names[turn:] + names[:turn]:
            work = partial(query.own, world) if name == "carom" else partial(query.peer, engines[name])
            with no_garbage_collection():
                took, _, answer = timed(partial(work, places, side))
            if number:
                seconds[name].append(took)
                figures[name] += answer / ROUNDS
    return {name: (seconds[name], {query.figure: figures[name]}) for name in names}


# -- quality of a state ----------------------------------------------------------------------------------


class Untouched(System):
    """Leaves overlaps as they are."""

    phase = Phase.NARROW

    def process(self, dt: float) -> None:
        self.world.contacts.enabled[:] = False


class Quality:
    """Quality of one engine's run: call :meth:`sample` at intervals, :meth:`figures` at the end of a window.

    world: one of carom at its start, which gets the positions whose overlaps are asked for, and takes a step without a
    motion for its contacts.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self._order = np.argsort(world.bodies.dynamic.entity, kind="stable")
        self.start, _, self.mass = dynamic_by_id(world)
        self.kinetic, self.enclosure = world.kinetic_energy(), Enclosure.around(world)
        self.inertia = inertia_by_id(world)
        world.settings, world.gravity = world.settings.replace(dt=INSTANT, collision="discrete"), 0
        world.add_system(Untouched())
        self.begin()

    def begin(self) -> None:
        """Discard the overlaps of the previous window."""
        self.overlap_means, self.overlap_most, self.first = [], 0.0, None

    def sample(self, position: Floats, angle: Floats) -> None:
        """Record the overlaps at ``position`` (n, 2) and ``angle`` (m,), also of the kinematic bodies."""
        self.world.bodies.dynamic.position[self._order] = position
        if np.isfinite(self.inertia).any():
            self.world.bodies.rotation[moving_rows(self.world)] = angle
        self.world.bodies.dynamic.linear_velocity = self.world.bodies.kinematic.linear_velocity = 0
        self.world.step()
        self.first = position if self.first is None else self.first
        depths = overlaps_of(self.world)[2]
        self.overlap_means.append(float(depths.mean()) if len(depths) else 0.0)
        self.overlap_most = max(self.overlap_most, float(depths.max(initial=0.0)))

    def figures(self, position: Floats, velocity: Floats, spin: Floats) -> dict[str, float]:
        """Energies in J, overlaps in diameters, drift (sideways) and sink (downwards) in m since the start, creep in m
        since the first sample of the window."""
        finite = np.isfinite(position).all(axis=1) & np.isfinite(velocity).all(axis=1)
        way = (position - self.start)[finite]
        spins = np.isfinite(self.inertia) & finite
        energy = self.mass[finite] @ (velocity[finite] ** 2).sum(axis=1)
        energy += self.inertia[spins] @ spin[: len(spins)][spins] ** 2
        crept = 0.0 if self.first is None else np.linalg.norm(position - self.first, axis=1)[finite].max(initial=0.0)
        return {
            "kinetic_start": self.kinetic,
            "kinetic_end": float(0.5 * energy),
            "overlap_mean": float(np.mean(self.overlap_means)) if self.overlap_means else 0.0,
            "overlap_max": self.overlap_most,
            "escaped": float(self.enclosure.outside(position[finite]) + (~finite).sum()),
            "drift": float(np.abs(way[:, 0]).max(initial=0.0)),
            "sink": float((-way[:, 1]).max(initial=0.0)),
            "creep": float(crept),
        }
