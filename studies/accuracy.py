"""The trade of scenes with a known answer, in short tables, beside what others have published."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

import click
from rich.console import Console

from carom.lab.cli.options import WORDS, KeepsWords, out_option
from carom.lab.jobs.runs import Store
from carom.lab.measure.timing import Spread
from carom.lab.reporting.progress import Progress
from carom.lab.reporting.text import NOTHING, TextTable, compact, number
from carom.lab.trading.charts import draw
from carom.lab.trading.records import PYMUNK, CaseTrade, Cell, Curve, ErrorBar, Point
from carom.lab.trading.report import ENERGY_SQUARE, ERROR_UNIT, failures, order, remarks
from carom.lab.trading.trade import trade

from .page import between_marks, into_option, show


@click.command("accuracy", cls=KeepsWords)
@click.argument("scene")
@click.option("--against", type=click.Choice([PYMUNK]), help="The same scene in this engine, on the same axes.")
@click.option("--runs", "kept", type=click.Path(path_type=Path), default=Path("out/runs.sqlite"), show_default=True)
@out_option("Draw charts into this folder.")
@into_option
@click.pass_context
def accuracy_command(
    context: click.Context, scene: str, against: str | None, kept: Path, out: Path | None, into: Path | None
) -> None:
    """Measure a scene as `carom trade SCENE --thorough` does: a row per method."""
    mark = f"studies accuracy {scene}"
    if into is not None:
        between_marks(into, mark)  # Problem, before the long run, for a page without the marks
    command = shlex.join(["python", "-m", "studies", "accuracy", *context.meta[WORDS]])
    with Store(kept) as store, Progress(Console(stderr=True)) as bar:
        result = trade(scene, against_pymunk=against == PYMUNK, store=store, progress=bar, command=command)
    (case,) = result.cases
    others = published(case.scene, case.norm)
    show([summary(case)], [*remarks(result), *[SOURCE] * bool(others)], into, mark)
    case.curves += others
    if out is not None:
        for path in draw(result, out):
            click.echo(f"chart: {path}", err=True)


# -- a short table -----------------------------------------------------------------------------------------------

TARGETS = (0.1, 0.01, 0.001, 1e-6)


def target_text(target: float, norm: str) -> str:
    """`0.1 %` for a relative error; with the unit for a norm that has one."""
    if norm == ENERGY_SQUARE:
        return f"{target:g} {ERROR_UNIT}".replace("e-0", "e-")
    return f"{100 * target:g} %" if target >= 1e-3 else f"{target:g}".replace("e-0", "e-")


def summary(case: CaseTrade, targets: Sequence[float] = TARGETS) -> TextTable:
    """By method: the observed order of each norm with the theoretical one; for each target the largest step that meets
    it in all repeats, with its work per simulated second; the best error; and the failures. Methods with the
    same figures share a row."""
    norm = case.norm
    trusted = [target for target in targets if case.reference.trusts(norm, target)]
    headings = ["method", *(f"{name}, order" for name in case.norms), *(target_text(t, norm) for t in trusted), "best"]
    failing = any(point.failed for curve in case.curves for point in curve.points)
    labels: dict[tuple[str, ...], list[str]] = {}
    for curve in case.curves:
        row = [order(curve, name) for name in case.norms]
        row += [_step(curve, norm, target) for target in trusted]
        errors = [point.errors[norm].high for point in curve.points if not point.failed and norm in point.errors]
        failed = [f"{number(point.cell.dt)}: {failures(point)}" for point in curve.points if point.failed]
        row += [compact(min(errors), 2) if errors else NOTHING, *["; ".join(failed) or NOTHING] * failing]
        labels.setdefault(tuple(row), []).append(curve.label)
    rows = [("; ".join(methods), *row) for row, methods in labels.items()]
    title = (
        f"{case.scene}: orders observed (and in theory); the largest step, s, that keeps {norm} below the target, and "
        f"its work per simulated second"
    )
    return TextTable(title, (*headings, *["failed"] * failing), rows)


def _step(curve: Curve, norm: str, target: float) -> str:
    """The largest step that meets the target together with all smaller ones."""
    kept: Point | None = None
    for point in reversed(curve.points):
        if not point.meets(norm, target):
            break
        kept = point
    return NOTHING if kept is None else f"{number(kept.cell.dt)}: {compact(kept.work, 2)}"


# -- published figures --------------------------------------------------------------------------------------------

SCENE, NORM = "bouncing", "energy_square"  # where the points belong; the norm is a mean of squares, in J²
SECONDS = 20.0  # simulated time that the published times are for

SOURCE = (
    "RaiSim, ODE, Bullet, DART: published by SimBenchmark (leggedrobotics/SimBenchmark, data/bouncing, error reduction"
    " off); times of another machine (Intel i7-7700HQ, 49 balls)"
)


def _curve(engine: str, *rows: tuple[float, float, float]) -> Curve:
    """A curve of (dt in s, error in J², processor seconds for all of SECONDS)."""
    points = [
        Point(Cell(dt, engine=engine), 1, {NORM: ErrorBar.of([error])}, {}, {}, 0.0, Spread.of([1e3 * spent / SECONDS]))
        for dt, error, spent in rows
    ]
    return Curve(f"{engine}, published", points[::-1])


# fmt: off
BOUNCING = [
    _curve("RaiSim", (1e-5, 1.86e-10, 23.7), (1e-4, 1.86e-6, 2.37), (1e-3, 0.0186, 0.235), (1e-2, 186.0, 0.025),
           (0.1, 1.83e6, 0.0027)),
    _curve("ODE", (1e-5, 0.0185021, 192.0), (1e-4, 1.85054, 19.8), (1e-3, 185.027, 1.89), (1e-2, 18808.3, 0.19),
           (0.1, 2.03e6, 0.021)),
    _curve("Bullet", (1e-5, 7.52, 81.0), (1e-4, 752.0, 8.2), (1e-3, 75245.0, 0.85), (1e-2, 7.41e6, 0.10),
           (0.1, 7.68e8, 0.016)),
    _curve("DART", (1e-5, 7.39, 328.0), (1e-4, 483.0, 31.9), (1e-3, 72274.0, 3.2), (1e-2, 7.38e6, 0.34),
           (0.1, 7.67e8, 0.038)),
]
# fmt: on


def published(scene: str, norm: str) -> list[Curve]:
    """The curves for this scene and norm; none for most scenes."""
    return list(BOUNCING) if (scene, norm) == (SCENE, NORM) else []
