"""The answer of a trade in at most five lines, and its table."""

from __future__ import annotations

import math

from ..measure.timing import machine_line
from ..reporting.text import NOTHING, TextTable, compact, metres, number
from .errors import NEVER, SHARE
from .trade import FIELDS, Point, SceneTrade, Trade, seconds_text

FRAME = 1 / 60  # s: the frame of a game whose cost is told
MOST_TOLD = 4  # differences of one setting
DOUBTED = "*"  # marks an error that is too close to the reference's own


def answer(case: SceneTrade) -> list[str]:
    """The settings to paste; what the scene has now, what the choice costs, what one step more would buy, and what
    inputs that are read once a step do."""
    if case.refused:
        return [f"{case.scene}: not measured: {case.refused}"]
    name = f"{case.scene}{' (chaotic: means over seeds)' * case.chaotic}"
    if case.doubt > SHARE * case.size:
        name += f" (places are known to {metres(case.doubt)} only)"
    own, chosen, more = case.own, case.chosen, case.more
    if chosen is None:
        return [f"{name}: {_none_meets(case)}"]
    lines = [f"{name}: use {chosen.line}{' (as it has now)' * (own is chosen)}"]
    if own is not None and own is not chosen:
        lines[0] += f", {_ratio(chosen, own)} times the cost of {own.line} now"
        lines.append(f"  now   {_cost(own)}; {_noticed(own)}")
    told = [_cost(chosen), _noticed(chosen)]
    if case.max_error < math.inf:
        errors = (in_unit(case, error) for error in (case.error(chosen), case.max_error))
        told.insert(1, f"{' of the '.join(errors)} allowed in {case.norm}")
    if chosen.severity <= 1:
        worst = max(chosen.figures.values(), key=lambda figure: figure.times)
        of_game = [chosen.figures[name].text for name in case.game if name in chosen.figures]
        told += of_game[:MOST_TOLD] or [worst.text] * bool(worst.text)
    lines.append(f"  use   {'; '.join(told)}")
    if more is not None:
        errors = f"{case.norm} error {in_unit(case, case.error(more))} instead of {in_unit(case, case.error(chosen))}"
        once = " (in one run)" * (more.repeats < chosen.repeats)
        lines.append(f"  more  {more.line}: {_ratio(more, chosen)} times the cost; {errors}; {_noticed(more)}{once}")
    late = [f"{1e3 * dt:.3g} ms: {'; '.join(words[:2]) or 'nothing is noticed'}" for dt, words in case.inputs.items()]
    if late:
        lines.append(f"  keys  read once a step, which is in no error above: {'; '.join(late)}")
    return lines


def _none_meets(case: SceneTrade) -> str:
    """Why there is no answer, and the best that there is."""
    if not case.usable:
        failed = "; ".join(dict.fromkeys(point.failed for point in case.points if point.failed))
        return f"nothing that was tried can be used: {failed}"
    if case.unknowable:
        return (
            f"no reference is exact enough for a {case.norm} error of {case.max_error:.3g}: {case.reference} tell it "
            f"to {case.agreement[case.norm]:.2g} only; take a larger error, a shorter time or a smaller --dt"
        )
    least, best = min(case.usable, key=lambda point: point.work), min(case.usable, key=case.error)
    if case.max_error == math.inf:
        wanted = f"{case.max_cost * FRAME:g} ms a frame or less"
        return f"nothing that was tried costs {wanted}: the cheapest, {least.line}, {_cost(least)}"
    cost = f" at {case.max_cost * FRAME:g} ms a frame" * (case.max_cost < math.inf)
    return (
        f"no settings keep the {case.norm} error below {case.max_error:.3g}{cost}: the best of {len(case.usable)} has "
        f"{case.error(best):.3g}, {best.line}"
    )


def in_unit(case: SceneTrade, error: float) -> str:
    """An error in metres if the norm is one of place, else as a share."""
    return metres(error * case.scale) if case.norm in ("position", "apex") else f"{compact(100 * error, 2)} %"


def _noticed(point: Point) -> str:
    texts = [point.failed] * bool(point.failed) + [figure.text for _, figure in point.noticed]
    more = f"; {len(texts) - MOST_TOLD} more" if len(texts) > MOST_TOLD else ""
    return f"noticed: {'; '.join(texts[:MOST_TOLD])}{more}" if texts else "nothing is noticed"


def _cost(point: Point) -> str:
    if point.milliseconds is None:
        return f"work {point.work:.3g} per simulated second (not timed)"
    frame = point.milliseconds * FRAME
    text = f"{1e3 * frame:.3g} us" if frame < 1 else f"{frame:.3g} ms"
    return f"{text} per frame of 1/60 s on this machine, {100 * frame / (1e3 * FRAME):.2g} % of it"


def _ratio(point: Point, other: Point) -> str:
    """The cost of one in units of the other's: of times where both are known, else of work."""
    if point.milliseconds and other.milliseconds:
        return f"{point.milliseconds / other.milliseconds:.2g}"
    return f"{point.work / other.work:.2g}"


# -- the table --------------------------------------------------------------------------------------------------------


def curves(case: SceneTrade) -> dict[str, list[Point]]:
    """The points by method, named by the fields in which they differ, from the largest step to the smallest."""
    differ = [name for name in FIELDS[1:] if len({getattr(point.settings, name) for point in case.points}) > 1]
    found: dict[str, list[Point]] = {}
    for point in sorted(case.points, key=lambda point: -point.settings.dt):
        words = {name: str(getattr(point.settings, name)).replace("_", " ") for name in differ}
        if point.settings.collision == "event_driven":
            words.pop("integrator", "")  # its flight is its own
        if "substeps" in words:
            words["substeps"] += " substeps"
        found.setdefault(", ".join(words.values()) or point.settings.integrator.replace("_", " "), []).append(point)
    return found


def table(case: SceneTrade, norm: str = "") -> TextTable:
    """One row for each setting, with what is noticed most, times the least that a player would. norm: instead of the
    case's first."""
    norm = norm if norm in case.norms else case.norm
    mark = {id(case.own): "now", id(case.more): "more", id(case.chosen): "use"}
    rows = []
    for label, points in curves(case).items():
        for point in points:
            figure = point.figures.get(norm)
            error = NOTHING if figure is None else compact(figure.error)
            error += DOUBTED * (figure is not None and not case.trusts(norm, figure.error))
            worst = ""
            for name, noticed in point.noticed[:1]:
                worst = f"{name} x {compact(noticed.times, 2)}" if noticed.times < NEVER else name
            step, runs = seconds_text(point.settings.dt), str(point.repeats)
            rows.append((label, step, runs, error, compact(point.work), point.failed or worst, mark.get(id(point), "")))
    title = f"{case.scene}: worst error of all runs ({norm}), work per simulated second"
    return TextTable(title, ("method", "step, s", "runs", "error", "work", "noticed", ""), rows, left=(5, 6))


def remarks(trade: Trade) -> list[str]:
    """The machine and, for each case, what was measured, against what, and how reliable it is."""
    lines = [machine_line(trade.machine), *[trade.command] * bool(trade.command)]
    for case in (case for case in trade.scenes if not case.refused):
        kind = "chaotic, judged by statistics" if case.chaotic else "no chaos"
        lines.append(f"{case.scene}: {number(case.seconds)} s; {case.why}: {kind}")
        lines.append(f"{case.scene}: {case.norm}: {case.norms[case.norm]}")
        own = compact(case.agreement.get(case.norm, 0.0), 2)
        lines.append(f"{case.scene}: reference: {case.reference}, right to {own}; {DOUBTED}: less than ten times that")
    return lines
