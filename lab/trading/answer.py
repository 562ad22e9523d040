"""The answer of a trade in words: the settings to paste, their cost and error, and what would be noticed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..measure.effects import in_words, severity, told
from ..wording import counted, metres
from .records import CAROM, CHAOTIC, RESTING, CaseTrade, Cell, Point, known_well
from .report import failures

FRAME = 1 / 60  # s: the frame of a game whose cost is told
FACTOR = 2.0  # a better choice is better by this
CLEARLY = 4.0  # times; start phases differ by less
MOST_TOLD = 5  # values of a game
HARDLY = 1.25  # times the cost: no reason to change settings
CHEAPER = 1 / HARDLY


def answer(case: CaseTrade) -> list[str]:
    """Lines for one scene: the settings to paste, and what the next cheaper and the next better choice would change."""
    if case.refused:
        return [f"{case.scene}: not measured: {case.refused}"]
    points = _points(case)
    usable = [point for point in points if not point.failed and case.norm in point.errors]
    if not usable:
        failed = "; ".join(dict.fromkeys(failures(point) for point in points if point.failed))
        return [f"{case.scene}: nothing that was tried can be used{f': {failed}' if failed else ' yet'}"]
    usable = known_well(usable)
    chosen = recommended(case, usable)
    now = next((point for point in points if point.cell == case.own), None)
    name = " (as it has now)" if chosen is now else ""
    lines = [f"{case.scene}: use {chosen.line}{name}"]
    lines.append(f"  cost     {cost_text(chosen)}")
    lines.append(f"  error    {_error(case, chosen)}")
    lines.append(f"  noticed  {noticed_text(chosen)}")
    best = front(usable)
    cheaper = [point for point in best if point is not now and price(point) < CHEAPER * price(chosen)]
    better = [
        point for point in best
        if point is not now and price(point) > price(chosen)
        and severity(point.effects) * FACTOR <= severity(chosen.effects)
        and (case.kind != RESTING or _sink(point) < _sink(chosen))
    ] if _can_be_better(case, chosen) else []  # fmt: skip
    if now is not None and now is not chosen:
        lines.append(f"  now      {_compared(case, now, chosen)}")
    if cheaper:
        lines.append(f"  cheaper  {_compared(case, cheaper[-1], chosen)}")
    if better:
        lines.append(f"  better   {_compared(case, better[0], chosen)}")
    if case.kind == CHAOTIC:
        lines.append(f"  judged   by means over seeds, because {case.why}")
    lines.append(f"  known    {_known(case, points, chosen.repeats)}")
    return lines


def recommended(case: CaseTrade, usable: Sequence[Point]) -> Point:
    """The cheapest of which nothing would be noticed, or hardly more than with the best of all; the scene's own
    settings if they cost hardly more."""
    least = max(min(severity(point.effects) for point in usable), 1.0)
    good = [point for point in usable if severity(point.effects) <= (HARDLY * least if least > 1.0 else 1.0)]
    cheapest = min(good, key=price)
    own = [point for point in good if point.cell == case.own and price(point) < HARDLY * price(cheapest)]
    return own[0] if own else cheapest


def _sink(point: Point) -> float:
    return point.effects.get("sink", 0.0)


def _can_be_better(case: CaseTrade, chosen: Point) -> bool:
    """True if something is known of its errors that others could improve; of games that is what would be noticed."""
    improves = severity(chosen.effects) > 1.0 or not told(chosen.effects)
    return improves and case.reference.trusts(case.norm, chosen.errors[case.norm].mean)


def _points(case: CaseTrade) -> list[Point]:
    return [point for point in case.points if point.cell.engine == CAROM]


def price(point: Point) -> float:
    """Milliseconds per simulated second; work where nothing is timed."""
    return point.milliseconds.median if point.milliseconds else point.work


def clearly_worse(points: Sequence[Point]) -> set[Cell]:
    """The settings of which something is noticed CLEARLY more than of others that cost hardly more: more runs of them
    would change no answer."""

    def harm(point: Point) -> float:
        return math.inf if point.failed else severity(point.effects)

    return {
        point.cell for point in points if harm(point) > 1.0 and any(
            CHEAPER * price(other) <= price(point) and CLEARLY * harm(other) <= harm(point)
            for other in points if not other.failed
        )
    }  # fmt: skip


def front(usable: Sequence[Point]) -> list[Point]:
    """The points of which none is cheaper and better at once, the cheapest first."""
    found: list[Point] = []
    for point in sorted(usable, key=lambda point: (price(point), severity(point.effects))):
        if not found or severity(point.effects) < severity(found[-1].effects):
            found.append(point)
    return found


def cost_text(point: Point) -> str:
    if point.milliseconds is None:
        return f"work {point.work:.3g} per simulated second (not timed)"
    frame = point.milliseconds.median * FRAME
    text = f"{1e3 * frame:.3g} us" if frame < 1 else f"{frame:.3g} ms"
    return f"{text} per frame of 1/60 s on this machine, {100 * frame / (1e3 * FRAME):.2g} % of it"


def _error(case: CaseTrade, point: Point) -> str:
    effects = point.effects
    of_game = told(effects)
    if of_game:
        return "; ".join(of_game[:MOST_TOLD])
    if case.kind == RESTING and "sink" in effects:
        return f"{metres(effects['sink'])}: how deep what rests sinks into what it rests on"
    if case.kind not in (CHAOTIC, RESTING) and "place" in effects:
        return f"{metres(effects['place'])}: how far a body ends from where it should after {case.seconds:g} s"
    bar = point.errors[case.norm]
    return f"{100 * bar.high:.2g} % in {case.norm} ({case.norms[case.norm].partition(';')[0]})"


def noticed_text(point: Point) -> str:
    words = [failures(point)] * point.failed + in_words(point.effects)
    return "; ".join(words) or "nothing"


def _compared(case: CaseTrade, point: Point, chosen: Point) -> str:
    ratio = price(point) / price(chosen)
    words = noticed_text(point)
    if words == "nothing" and case.norm in point.errors and not point.failed and not told(point.effects):
        words = f"nothing; error {_error(case, point).partition(':')[0]}"
    return f"{point.line}: {ratio:.2g} times the cost; noticed: {words}"


def _known(case: CaseTrade, points: Sequence[Point], repeats: int) -> str:
    runs = sum(point.repeats for point in points)
    text = f"from {counted(runs, 'run')} of {case.seconds:g} s with {counted(len(points), 'setting')}"
    if repeats < case.whole:
        text += f", {repeats} of {case.whole} {case.repeated} with these"
    if case.missing:
        text += f"; {counted(case.missing, 'setting')} not tried yet"
    if case.rough:
        return f"{text}; {rough_text(case)}"
    short = repeats < case.whole or case.missing
    return text + ("; the same command goes on, --thorough does it all" if short else "")


def rough_text(case: CaseTrade) -> str:
    """What to think of errors without references, and what it takes to have some."""
    more = f": {more_budget(case)} tells more" if case.needed else ""
    return f"rough, against {case.reference.text} only{more}"


def more_budget(case: CaseTrade) -> str:
    """The budget with which there are references, as far as that is known."""
    return f"--budget {math.ceil(case.needed / 10) * 10}" if case.needed else "a larger --budget"
