"""The random sweep as tables: what went wrong in each mode, and where, by bins of one axis and by the other one."""

from __future__ import annotations

from ....reporting.text_tables import TextTable
from ....wording import NOTHING
from ..records import MODES
from ..report import number
from .axes import (
    AXES,
    DISCRETE_WALL,
    DISCRETE_WAY,
    DT,
    FARTHEST,
    HEAVIEST,
    NAMES,
    STABLE,
    SWEPT_FALL,
    SWEPT_WAY,
    CrossedAxis,
    Draw,
)
from .scenes import Outcome
from .sweep import PairLimits

SHOWN = 8  # numbers of failed scenes that are listed
Played = list[tuple[Draw, Outcome]]

VALID = {
    "discrete": (
        f"the way in a step, with the speed of the fall, is at most {DISCRETE_WAY:g} of the smallest size, walls are "
        f"at least {DISCRETE_WALL:g} radius thick. Faster or thinner: it may pass, by contract; use continuous"
    ),
    "continuous": (
        f"any speed, gravity, ratio of masses and sizes, any wall; but no more than {SWEPT_WAY:g} sizes in a step "
        f"where also gravity makes more than {SWEPT_FALL:g}, or springs act. What fails in it is a defect"
    ),
    "event_driven": "as continuous",
}
EVERYWHERE = (
    f"In every mode: at most {number(FARTHEST)} sizes from the origin; stacks of masses up to 1 to "
    f"{number(HEAVIEST)}; springs up to w dt = 2 "
    f"({', '.join(f'{name} {limit:g}' for name, limit in STABLE.items())}). Scenes outside are counted apart."
)


def tables(result: PairLimits) -> list[TextTable]:
    """One of all failures, one for each mode of where they are."""
    scenes = list(zip(result.draws(), result.outcomes, strict=True))
    return [_failures(scenes), *(_crossed(mode, scenes) for mode in MODES)]


def remarks(result: PairLimits) -> list[str]:
    """The valid range of each mode, and how to read the tables."""
    scenes = list(zip(result.draws(), result.outcomes, strict=True))
    lines = [f"Valid range of {mode}: {text}." for mode, text in VALID.items()]
    for mode in MODES:
        failed = [draw.number for draw, outcome in scenes if draw.mode == mode and _failed(outcome)]
        if failed:
            more = ", ..." if len(failed) > SHOWN else ""
            numbers = ", ".join(map(str, failed[:SHOWN]))
            lines.append(f"Failed in {mode}: scenes {numbers}{more} of seed {result.seed}.")
    return [
        *lines,
        EVERYWHERE,
        f"{len(scenes)} scenes of seed {result.seed}. Failed: a body lost or not finite, a stack out of order, energy "
        f"grown by 1 %, or an error. carom {result.machine['carom']}, numpy {result.machine['numpy']}.",
    ]


def described(draw: Draw, outcome: Outcome) -> str:
    """One scene in words: what was drawn, and what became of it."""
    holder = f"walls of {draw.wall:g} radii" if draw.kind == "room" else f"floor: {draw.floor}"
    crossed = ", ".join(f"{AXES[NAMES.index(name)].title} {draw.values[name]:.6g}" for name in draw.crossed)
    others = ", ".join(f"{name} {value:g}" for name, value in draw.values.items() if name not in draw.crossed)
    gain = "not judged" if outcome.gain is None else f"{outcome.gain:.3g} of that at the start"
    lines = [
        f"scene {draw.number} of seed {draw.seed}: {draw.kind} in {draw.dimensions}D, {draw.shape}, {holder}",
        f"settings: {draw.mode}, {draw.integrator}, dt {DT:.6g} s; gravity {draw.gravity:.6g} m/s^2, "
        f"speed {draw.speed:.6g} m/s",
        f"crossed: {crossed}",
        f"others: {others}",
        f"outside the valid range: {', '.join(outcome.outside) or 'no'}",
        f"failures: {', '.join(outcome.failures) or 'none'}" + ("" if outcome.broken is None else
                                                              f", from step {outcome.broken} on"),
        f"lost {outcome.lost}, not finite {outcome.not_finite}, energy gained: {gain}, faults {outcome.faults}",
        *([f"refused: {outcome.refused}"] if outcome.refused else []),
    ]  # fmt: skip
    return "\n".join(lines)


def _failed(outcome: Outcome) -> bool:
    return bool(outcome.failures) and not outcome.outside


def _failures(scenes: Played) -> TextTable:
    rows = []
    for mode in MODES:
        for outside in (False, True):
            found = [(draw, o) for draw, o in scenes if draw.mode == mode and bool(o.outside) == outside]
            if not found:
                continue
            elastic = [o for draw, o in found if draw.values["restitution"] == 1.0 and "energy" in o.failures]
            kinds = [[o for _, o in found if word in o.failures] for word in ("lost", "not finite", "order", "energy")]
            counts = (*map(len, kinds[:3]), len(elastic), len(kinds[3]) - len(elastic))
            refused = sum(bool(o.refused) for _, o in found)
            silent = sum(bool(o.lost) and not o.faults for _, o in found)
            slowest = max(o.slowest for _, o in found)
            name = f"{mode}, outside its range" if outside else mode
            rows.append(
                (
                    name,
                    *(str(n) for n in (len(found), *counts, refused, silent)),
                    f"{number(float(f'{1e3 * slowest:.2g}'))} ms",
                )
            )
    headings = (
        "mode", "scenes", "lost", "not finite", "order", "energy, e = 1", "energy, e < 1", "refused", "lost, no fault",
        "slowest step",
    )  # fmt: skip
    return TextTable("Random scenes that failed, by mode", headings, rows)


def _crossed(mode: str, scenes: Played) -> TextTable:
    """One row per bin, one column per other axis: scenes that failed, of those within the valid range."""
    rows = []
    for axis in AXES:
        for place in range(len(axis.bins)):
            cells = [_cell(mode, axis.name, place, other, scenes) for other in NAMES]
            rows.append((axis.title if place == 0 else "", _bin(axis, place), *cells))
    return TextTable(f"{mode}: scenes that failed / within the valid range", ("axis", "bin", *NAMES), rows, 2)


def _cell(mode: str, name: str, place: int, other: str, scenes: Played) -> str:
    found = [
        outcome for draw, outcome in scenes
        if draw.mode == mode and draw.crossed.get(name) == place and other != name and other in draw.crossed
        and not outcome.outside
    ]  # fmt: skip
    return f"{sum(map(_failed, found))} / {len(found)}" if found else NOTHING


def _bin(axis: CrossedAxis, place: int) -> str:
    low, high = axis.bins[place]
    return number(low) if low == high else f"{number(low)} .. {number(high)}"
