"""The answer of a trade: the settings to use, and at most five lines that say why.

It depends on the points alone. Choices are made by counts of work, which are the same on every machine and in every
call; the times of this machine are told, and refuse a choice that they do not show to be cheaper.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from ..cases.case import Case
from ..measure.effects import in_words, severity, told
from ..reporting.text import compact, counted, metres
from .records import RESTING, CaseTrade, Cell, Point, Reference
from .report import failures

FRAME = 1 / 60  # s: the frame of a game whose cost is told
FACTOR = 2.0  # a better choice is better by this
CLEARLY = 4.0  # times; start phases differ by less
MOST_TOLD = 5  # values of a game
HARDLY = 1.25  # times the cost: within it, costs are the same
CHEAPER = 1 / HARDLY
SAVES = 0.7  # of the measured time, at most, for what is cheaper by work: far from what halving a step or nothing saves
price = attrgetter("work")  # what a point costs, by the counts that are the same in every run
SEEN = 1.0  # of what a player would notice (1 % of the smallest body): a gain below it is none


@dataclass(frozen=True)
class Target:
    """What is asked for: the largest error, in the main norm, relative to its scale or ``absolute`` in the scene's
    units; or the largest cost, ms per frame of 1/60 s. ValueError for anything but a number above 0."""

    max_error: float | None = None
    max_cost: float | None = None
    absolute: bool = False

    def __post_init__(self) -> None:
        for name in ("max_error", "max_cost"):
            value = getattr(self, name)
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if value is not None and not (number and math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be a number above 0, got {value!r}")

    def error_of(self, case: CaseTrade) -> float:
        """The largest error, relative to the scale of the norm."""
        return self._relative(case.scale)

    def _relative(self, scale: float) -> float:
        assert self.max_error is not None
        return self.max_error / scale if self.absolute else self.max_error

    def is_known_by(self, case: Case, reference: Reference) -> bool:
        """True if that reference is exact enough to tell errors of that size."""
        norm = case.norms[0]
        if self.max_error is None or norm not in reference.agreement:
            return False
        return reference.trusts(norm, self._relative(case.scale(norm)))

    def is_unknowable(self, case: CaseTrade) -> bool:
        """True if the reference of the case cannot tell errors of that size."""
        if self.max_error is None or case.reference.is_statistic(case.norm):
            return False
        return not case.reference.trusts(case.norm, self.error_of(case))

    def meets(self, case: CaseTrade, point: Point) -> bool:
        """True for a point that keeps within it in all repeats, with the reference's own error."""
        if self.max_error is not None and error_of(case, point) > self.error_of(case):
            return False
        return self.max_cost is None or (point.milliseconds is not None and _frame(point) <= self.max_cost)


def error_of(case: CaseTrade, point: Point) -> float:
    """The error in the main norm at the worst of all repeats, with the reference's own."""
    return point.errors[case.norm].high + case.reference.agreement.get(case.norm, 0.0)


def recommended(case: CaseTrade, target: Target | None = None) -> Point | None:
    """The point to use; None if nothing can be used, or if nothing meets the target.

    Without a target: the cheapest of which nothing would be noticed, or hardly more than with the best of all. The
    scene's own settings if the others cost hardly less, and if a player would not see what they gain. With a target the
    cheapest that meets its error; with its cost only, the one of which least is noticed. Of several that cost nearly
    the same, the one that changes least.
    """
    points = case.usable
    if target is not None:
        points = [point for point in points if target.meets(case, point) and not target.is_unknowable(case)]
    if not points:
        return None
    now = next((point for point in points if point.cell == case.own), None)
    if target is not None and target.max_error is None:
        best = min(points, key=lambda point: (max(severity(point.effects), SEEN), price(point)))
        return now if now is not None and _gain(now, best) <= SEEN else best
    points = [
        point for point in points
        if now is None or not _is_cheaper_by_work_only(point, now) or _gain(now, point) > SEEN
    ]  # fmt: skip
    if target is not None:
        cheapest = _nearest(case, points)
        return now if now is not None and not _is_cheaper(cheapest, now) else cheapest
    least = max(min(severity(point.effects) for point in points), SEEN)
    good = [point for point in points if severity(point.effects) <= (HARDLY * least if least > SEEN else SEEN)]
    cheapest = _nearest(case, good)
    if now is None or _is_cheaper(cheapest, now) or _gain(now, cheapest) > SEEN:
        return cheapest
    return now


def _nearest(case: CaseTrade, points: Sequence[Point]) -> Point:
    """Of the cheapest, and those that cost hardly more, the one with the fewest changes of the scene's own settings."""
    least = min(map(price, points))
    own = case.own or points[0].cell

    alike = [point for point in points if price(point) <= HARDLY * least]

    def order(point: Point) -> tuple[Any, ...]:
        return point.cell.differences(own), price(point), severity(point.effects), point.cell.key

    return min(alike, key=order)


def _gain(now: Point, other: Point) -> float:
    """How much less would be noticed, in limits of what is noticed."""
    return severity(now.effects) - severity(other.effects)


def _is_cheaper(point: Point, now: Point) -> bool:
    return HARDLY * price(point) < price(now)


def _is_cheaper_by_work_only(point: Point, now: Point) -> bool:
    """True if the clock does not show what the counts say."""
    if not (point.alone and now.alone and point.milliseconds and now.milliseconds) or price(point) >= price(now):
        return False
    return point.milliseconds.low > SAVES * now.milliseconds.low


def answer(case: CaseTrade, target: Target | None = None) -> list[str]:
    """At most five lines: the settings to paste and why, their cost, their error, the next choice, and the inputs."""
    if case.refused:
        return [f"{case.scene}: not measured: {case.refused}"]
    usable = case.usable
    if not usable:
        failed = "; ".join(dict.fromkeys(failures(point) for point in case.points if point.failed))
        return [f"{case.scene}: nothing that was tried can be used{f': {failed}' if failed else ''}"]
    chosen = recommended(case, target)
    if chosen is None:
        assert target is not None
        return [f"{case.scene}: {_none_meets(case, target)}"]
    lines = [f"{case.scene}: use {chosen.line}{_why(case, chosen, target)}", f"  cost     {cost_text(chosen)}"]
    asked = ""
    if target is not None and target.max_error is not None:
        error, allowed = (in_unit(case, value) for value in (error_of(case, chosen), target.error_of(case)))
        asked = f"{error} of the {allowed} allowed, in {case.norm}; "
    lines.append(f"  error    {asked}{_error(case, chosen)}; noticed: {noticed_text(chosen)}")
    found = next_choice(case, chosen)
    if found is not None:
        name, other = found
        error = f"; error {in_unit(case, error_of(case, other))}" if asked else ""
        told_of = f"{_ratio(other, chosen)} times the cost; noticed: {noticed_text(other)}{error}"
        lines.append(f"  {name:8} {other.line}: {told_of}")
    return [*lines, *_inputs(case)]


def _why(case: CaseTrade, chosen: Point, target: Target | None) -> str:
    """Why this and not what the scene has now."""
    if chosen.cell == case.own:
        return " (as it has now)"
    now = next((point for point in case.points if point.cell == case.own), None)
    if now is None:
        return ""
    if now.failed or target is not None:
        why = f"which {failures(now)}" if now.failed else ""
        if target is not None and not target.meets(case, now):
            why = why or "which does not keep what you ask for"
        return f", {_ratio(chosen, now)} times the cost of {now.line} now{f', {why}' if why else ''}"
    text = f", {_ratio(chosen, now)} times the cost of {now.line} now"
    if price(chosen) <= price(now):
        same = noticed_text(now) == noticed_text(chosen) == "nothing"
        return f"{text}; nothing is noticed with either" if same else f"{text}; noticed with that: {noticed_text(now)}"
    return f"{text}, because a player sees the difference: with that {noticed_text(now)}"


def next_choice(case: CaseTrade, chosen: Point) -> tuple[str, Point] | None:
    """The next better choice, if something is noticed with the chosen one; else the next cheaper one."""
    best = front(case.usable)
    for point in best if case.reference.trusts(case.norm, chosen.errors[case.norm].mean) else ():
        twice = severity(point.effects) * FACTOR <= severity(chosen.effects)
        if price(point) > price(chosen) and twice and _gain(chosen, point) > SEEN:
            return "better", point
    cheaper = [point for point in best if price(point) < CHEAPER * price(chosen)]
    cheaper = [point for point in cheaper if not _is_cheaper_by_work_only(point, chosen)]
    return ("cheaper", cheaper[-1]) if cheaper else None


def _ratio(point: Point, other: Point) -> str:
    """The cost of one in units of the other's: of times where both are known, else of work."""
    if point.milliseconds and other.milliseconds:
        return f"{point.milliseconds.median / other.milliseconds.median:.2g}"
    return f"{point.work / other.work:.2g}"


def _inputs(case: CaseTrade) -> list[str]:
    """What it costs that a game reads its inputs once a step, which is in none of the errors."""
    if not case.inputs:
        return []
    words = []
    for dt, effects in case.inputs.items():
        late = "; ".join(in_words(effects)[:2]) or "nothing is noticed"
        words.append(f"{1e3 * float(dt):.3g} ms{' now' * (len(case.inputs) > 1 and not words)}: {late}")
    return [f"  inputs   read once a step, which is in no error above: {'; '.join(words)}"]


def _none_meets(case: CaseTrade, target: Target) -> str:
    """Why nothing meets the target, and the best that there is."""
    if target.max_error is None:
        least = min(case.usable, key=price)
        wanted = f"{target.max_cost:g} ms a frame or less"
        return f"nothing that was tried costs {wanted}: the cheapest, {least.line}, {cost_text(least)}"
    wanted = target.error_of(case)
    if target.is_unknowable(case):
        apart = case.reference.agreement[case.norm]
        return (
            f"no reference is exact enough for a {case.norm} error of {wanted:.3g}: {case.reference.text} agree to "
            f"{apart:.2g} only; take a larger error, a shorter time or --thorough"
        )
    best = min(case.usable, key=lambda point: error_of(case, point))
    cost = f" at {target.max_cost:g} ms a frame" if target.max_cost is not None else ""
    return (
        f"no settings keep the {case.norm} error below {wanted:.3g}{cost}: the best of "
        f"{counted(len(case.usable), 'setting')} has {error_of(case, best):.3g}, {best.line}"
    )


def in_unit(case: CaseTrade, error: float) -> str:
    """An error in metres if the norm is one of place, else as a share."""
    return metres(error * case.scale) if case.norm in ("position", "apex") else f"{compact(100 * error, 2)} %"


def clearly_worse(points: Sequence[Point]) -> set[Cell]:
    """The settings of which something is noticed CLEARLY more than of others that cost hardly more: more runs of them
    would change no answer."""

    def harm(point: Point) -> float:
        return math.inf if point.failed else severity(point.effects)

    return {
        point.cell for point in points if harm(point) > SEEN and any(
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


def _frame(point: Point) -> float:
    """ms per frame of 1/60 s."""
    return point.milliseconds.median * FRAME if point.milliseconds else math.nan


def cost_text(point: Point) -> str:
    if point.milliseconds is None:
        return f"work {point.work:.3g} per simulated second (not timed)"
    frame = _frame(point)
    text = f"{1e3 * frame:.3g} us" if frame < 1 else f"{frame:.3g} ms"
    return f"{text} per frame of 1/60 s on this machine, {100 * frame / (1e3 * FRAME):.2g} % of it"


def _error(case: CaseTrade, point: Point) -> str:
    effects = point.effects
    of_game = told(effects)
    if of_game:
        return "; ".join(of_game[:MOST_TOLD])
    if case.kind == RESTING and "sink" in effects:
        return f"{metres(effects['sink'])}: how deep what rests sinks into what it rests on"
    if "place" in effects:
        return f"{metres(effects['place'])}: how far a body ends from where it should after {case.seconds:g} s"
    return f"{100 * point.errors[case.norm].high:.2g} % in {case.norm} ({case.norms[case.norm].partition(';')[0]})"


def noticed_text(point: Point) -> str:
    words = [failures(point)] * point.failed + in_words(point.effects)
    return "; ".join(words) or "nothing"
