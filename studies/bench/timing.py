"""The times of the engines and the quality of their states, case by case, and the tables of both.

All engines start from the same world and take the same steps, some each by turns, on one core, so that what else the
machine does affects all alike. Each repeat begins from another seed: timing one state again and again would train the
branch predictor and give times that are too short.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from functools import partial

import click
import numpy as np

from carom.lab.cli.usage_errors import Problem
from carom.lab.measure.timing import machine_line, timed
from carom.lab.reporting.text import NOTHING, TextTable, compact, span

from ..runner import Axis, Result, Sample, ratios
from . import suite
from .engines import CAROM, PEERS, PYMUNK, Carom, Engine, module_of
from .plain import Floats
from .quality import Quality
from .queries import time_queries
from .suite import ESCAPED, GAP, SINKS, Case

LOOKS = 10  # at the quality of the states, per window
SEVERAL, SMALL = 10, 300  # steps that are timed at once in worlds of fewer bodies, whose steps are short
MOST_BODY_STEPS = 10_000_000  # of a window: of more bodies fewer steps are timed
REHEARSAL_SEED, REHEARSAL_STEPS = 1000, 30  # of the untimed run before the first repeat, which compiles the kernels


def axes(quick: bool = False) -> list[Axis]:
    """An axis for each scene, with its cases."""
    found = suite.cases(suite.QUICK, suite.QUICK[-1]) if quick else suite.cases()
    peers = _peers()
    measured = partial(measure, peers=peers)
    return [
        Axis(scene, "", tuple(case for case in found if case.scene == scene), measured)
        for scene in dict.fromkeys(case.scene for case in found)
    ]


def _peers() -> list[str]:
    """The engines that are installed; says on stderr which are not."""
    found = []
    for name in PEERS:
        try:
            module_of(name)
            found.append(name)
        except Problem as problem:
            click.echo(f"studies: no {name}: {problem.message}", err=True)
    return found


@contextlib.contextmanager
def one_core() -> Iterator[None]:
    """On one core inside, where the system can."""
    allowed = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
    try:
        if allowed:
            os.sched_setaffinity(0, {max(allowed)})
        yield
    finally:
        if allowed:
            os.sched_setaffinity(0, allowed)


def measure(case: Case, repeat: int, peers: list[str]) -> dict[str, float]:
    """One repeat of one case, by all engines: ``window/engine/figure``. ms: the median of the steps; p10: the time that
    a tenth of them stay below."""
    if repeat == 0:
        with case.build(seed=REHEARSAL_SEED) as rehearsal:
            Carom(rehearsal).step(REHEARSAL_STEPS)
    with case.build(seed=repeat) as world, one_core():
        if not case.windows:
            return {
                f"{query}/{name}/{figure}": value
                for query, name, seconds, answer in time_queries(world, case.size, repeat, PYMUNK in peers)
                for figure, value in {**_times(seconds), "answer": answer}.items()
            }
        return _windows(case, repeat, {CAROM: Carom(world), **{name: PEERS[name](world) for name in peers}})


def _windows(case: Case, repeat: int, engines: dict[str, Engine]) -> dict[str, float]:
    quality, names, taken, found = Quality(partial(case.build, seed=repeat)), list(engines), 0, {}
    at_once = SEVERAL if case.size < SMALL else 1
    start = quality.figures(engines[CAROM].state())["energy"]
    for window, (first, last) in case.windows.items():
        blocks = min(last - first, max(60, MOST_BODY_STEPS // case.size)) // at_once
        for engine in engines.values():
            engine.step(first - taken)
        seconds: dict[str, list[float]] = {name: [] for name in names}
        depths: dict[str, list[Floats]] = {name: [] for name in names}
        for block in range(blocks):
            turn = block % len(names)
            times = {name: timed(partial(engines[name].step, at_once)) for name in names[turn:] + names[:turn]}
            for name, (spent, counts, _) in times.items():
                if all(counts for _, counts, _ in times.values()):  # no kernel came meanwhile
                    seconds[name].append(spent / at_once)
                if block % max(1, blocks // LOOKS) == 0:
                    depths[name].append(quality.overlaps(engines[name].state()))
        if not seconds[CAROM]:
            raise Problem(f"{case}: kernels were compiled in all steps; run it once more")
        for name, engine in engines.items():
            figures, depth = quality.figures(engine.state()), np.concatenate(depths[name])
            figures |= {"kept": figures["energy"] / start if start else 0.0, "deepest": depth.max(initial=0.0)}
            figures |= {"overlap": depth.mean() if len(depth) else 0.0, **_times(seconds[name])}
            found |= {f"{window}/{name}/{figure}": float(value) for figure, value in figures.items()}
        taken = first + blocks * at_once
    return found


def _times(seconds: list[float]) -> dict[str, float]:
    return {"ms": 1e3 * float(np.median(seconds)), "p10": 1e3 * float(np.quantile(seconds, 0.1))}


# -- the tables -------------------------------------------------------------------------------------------------------


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """Times and ratios; the quality of the states, and the answers of queries; with a column for each engine there."""
    samples = [sample for line in result.lines for sample in line.samples]
    rows = [(one, window) for one in samples for window in dict.fromkeys(name.split("/")[0] for name in one.figures)]
    engines = [name for name in (CAROM, *PEERS) if any(f"{window}/{name}/ms" in one.figures for one, window in rows)]
    times, quality = [], []
    for sample, window in rows:
        of = {name: sample.figures.get(f"{window}/{name}/ms") for name in engines}
        cells = [
            NOTHING if ms is None else
            f"{compact(ms.median)}, {compact(sample.figures[f'{window}/{name}/p10'].median)}"
            for name, ms in of.items()
        ]  # fmt: skip
        own = sample.figures[f"{window}/{CAROM}/ms"]
        beside = [None if ms is None else ratios(ms, own) for ms in list(of.values())[1:]]
        cells += [NOTHING if one is None else f"{compact(one.median)} ({span(one)})" for one in beside]
        label = f"{sample.value} {window}".strip()
        times.append((label, *cells))
        if sample.value.size >= SMALL:
            quality.append((label, *_quality(sample, window, [name for name in engines if of[name] is not None])))
    title = f"ms per step, of player_query per 1,000 queries: median, tenth percentile; medians of {result.repeats}"
    heads = ("scene", *engines, *(f"{name} / {CAROM}" for name in engines[1:]))
    also = f"{' / '.join(engines)}: energy that is left; overlaps of the pairs that do; what else there is to see"
    return [
        TextTable(title, heads, times),
        TextTable(also, ("scene", "energy", "mean, mm", "deepest, mm", "also"), quality),
    ], [machine_line(result.machine)]


def _quality(sample: Sample, window: str, engines: list[str]) -> tuple[str, str, str, str]:
    """What there is to see of each engine, in four cells."""

    def each(figure: str, scale: float = 1.0, digits: int = 2) -> str:
        values = (sample.figures[f"{window}/{name}/{figure}"].median for name in engines)
        return " / ".join(compact(scale * value, digits) for value in values)

    watch = sample.value.watch
    if not sample.value.windows:
        return NOTHING, NOTHING, NOTHING, f"finds {each('answer', digits=6)}"
    also = {SINKS: "sinks {} m", GAP: "worst gap {} m", ESCAPED: "{} escaped", "": NOTHING}[watch]
    energy = f"{each('kept', 100, 5)} %" if watch == ESCAPED else f"{each('energy')} J"
    return energy, each("overlap", 1e3), each("deepest", 1e3), also.format(each(watch) if watch else "")
