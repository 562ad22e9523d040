"""The result of a search for settings, as tables and sentences: the choice, the reasons, the trials, the limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..plain import jsonable
from ..reporting.text_tables import TextTable
from ..trading.answer import cost_text, noticed_text
from ..trading.code_line import settings_line
from ..trading.records import ErrorBar, Point
from ..trading.report import failures, target_text, worst_heading
from ..trading.trade import label_of
from ..wording import NOTHING, compact, counted, metres, number
from .check import TOLERATED, Check
from .search import FAR_DEARER, Trial, Tuning


@dataclass
class TuneResult:
    """Everything that the command reports.

    balanced
        ``Settings.balanced()`` on the same scene, for comparison
    """

    command: str
    tuning: Tuning
    balanced: Point | None
    checks: list[Check]

    def as_dict(self) -> dict[str, Any]:
        """For JSON, which cannot represent infinity: the error of a failed run is null."""
        tuning, found = self.tuning, self.tuning.choice is not None
        told = (
            "scene", "norm", "text", "target", "scale", "seconds", "repeats", "repeated", "methods", "reference",
            "error", "choice", "runner_up", "trials",
        )  # fmt: skip
        checked = (
            "scene", "norm", "promise", "scale", "seconds", "tolerated", "refused", "reference", "point", "error",
            "times",
        )  # fmt: skip
        return jsonable({
            "command": self.command,
            **{name: getattr(tuning, name) for name in told},
            "settings": tuning.settings if found else None,
            "line": tuning.line if found else None,
            "why_not": "" if found else tuning.why_not,
            "margin": tuning.margin if found else None,
            "balanced": self.balanced,
            "checks": [{name: getattr(check, name) for name in checked} for check in self.checks],
        })  # fmt: skip


# -- the answer ---------------------------------------------------------------------------------------------------


def answer(tuning: Tuning) -> list[str]:
    """The settings to paste, what they cost, and what the next cheaper choice would change."""
    choice = tuning.choice
    rough = f"rough, against {tuning.reference.text} only" if tuning.rough else ""
    more = f"{tuning.stopped}, the same command goes on" if tuning.stopped else ""
    if choice is None:
        known = "; ".join(filter(None, (rough, more)))
        return [tuning.why_not, *[f"  known    {known}"] * bool(known)]
    allowed = f"of the {_in_unit(tuning, tuning.target)} allowed"
    lines = [
        f"{tuning.scene}: use {tuning.line}",
        f"  cost     {cost_text(choice)}",
        f"  error    {_in_unit(tuning, tuning.error)} {allowed}, in {tuning.norm}",
        f"  noticed  {noticed_text(choice)}",
    ]
    missed = [trial for trial in tuning.trials if not trial.met and trial.work < choice.work and not trial.failure]
    if missed:
        next_one = max(missed, key=lambda trial: trial.work)
        line = settings_line(next_one.cell, tuning.base)
        ratio = compact(next_one.work / choice.work, 2)
        least = "at least " if next_one.repeats < tuning.repeats else ""
        lines.append(f"  cheaper  {line}: {ratio} times the work, error {least}{_in_unit(tuning, next_one.error)}")
    if tuning.runner_up is not None:
        line = settings_line(tuning.runner_up.cell, tuning.base)
        error = _in_unit(tuning, tuning.runner_up.errors[tuning.norm].high)
        ratio = compact(tuning.runner_up.work / choice.work, 2)
        lines.append(f"  else     {line}: {ratio} times the work, error {error}")
    repeats = f"{choice.repeats} {tuning.repeated if choice.repeats > 1 else tuning.repeated[:-1]}"
    known = f"from {counted(len(tuning.trials), 'trial')}, {repeats} of {number(tuning.seconds)} s"
    return [*lines, f"  known    {'; '.join(filter(None, (known, rough, more)))}"]


def _in_unit(tuning: Tuning, error: float) -> str:
    """An error in metres if the norm is one of place, else as a share."""
    if tuning.norm in ("position", "apex"):
        return metres(error * tuning.scale)
    return f"{compact(100 * error, 2)} %"


# -- tables -----------------------------------------------------------------------------------------------------


def tables(result: TuneResult) -> list[TextTable]:
    """The trials, the comparison, and the checks on other scenes."""
    made = [tried_table(result.tuning), compared_table(result)]
    return [*made, checks_table(result)] if result.checks else made


def tried_table(tuning: Tuning) -> TextTable:
    """All trials in the order of the search."""
    cells = {trial.cell.method for trial in tuning.trials}
    rows = [
        (
            label_of(trial.cell.method, cells), number(trial.cell.dt), f"{trial.repeats:,}", _error(trial.error),
            compact(trial.work), _verdict(trial, tuning),
        )
        for trial in tuning.trials
    ]  # fmt: skip
    headings = ("method", "step, s", "runs", tuning.norm, "work", "")
    return TextTable(f"{tuning.scene}: what was tried, in this order", headings, rows)


def _verdict(trial: Trial, tuning: Tuning) -> str:
    if trial.failure:
        return trial.failure
    if trial.met:
        return "holds" if trial.repeats == tuning.repeats else "holds once"
    times = trial.error / tuning.target
    if times <= 1:
        return "misses with the reference's own error"
    return f"misses, {compact(times, 2 if times >= 2 else 3)} times"


def compared_table(result: TuneResult) -> TextTable:
    """The choice, the runner-up and ``Settings.balanced()``."""
    tuning = result.tuning
    named = [("choice", tuning.choice), ("runner-up", tuning.runner_up), ("balanced", result.balanced)]
    points = [(name, point) for name, point in named if point is not None]
    cells = {point.cell.method for _, point in points} | {trial.cell.method for trial in tuning.trials}
    rows = []
    for name, point in points:
        bar = None if point.failed else point.errors[tuning.norm]
        work = NOTHING if tuning.choice is None else compact(point.work / tuning.choice.work)
        rows.append((
            name, label_of(point.cell.method, cells), number(point.cell.dt), failures(point) or _worst(bar),
            _part(bar, tuning.target), compact(point.work), work,
        ))  # fmt: skip
    worst = worst_heading(tuning.reference, tuning.norm)
    headings = ("", "method", "step, s", worst, "of target", "work", "of choice's")
    title = f"{tuning.scene}: {tuning.norm}, and work per simulated second"
    return TextTable(title, headings, rows, words=2)


def checks_table(result: TuneResult) -> TextTable:
    """The choice on scenes that it was not tuned on."""
    rows = []
    for check in result.checks:
        if check.refused:
            rows.append((check.scene, NOTHING, NOTHING, NOTHING, NOTHING, "not measured"))
            continue
        times = compact(check.times) if math.isfinite(check.times) else NOTHING
        rows.append((
            check.scene, number(check.seconds), _worst(_bar(check)), compact(check.promise), times, _kept(check),
        ))  # fmt: skip
    worst = worst_heading(result.tuning.reference, result.tuning.norm)
    headings = ("scene", "over, s", worst, "promise", "times the promise", "")
    return TextTable("on scenes that it was not tuned on", headings, rows)


def _bar(check: Check) -> ErrorBar | None:
    return None if check.point is None or check.point.failed else check.point.errors[check.norm]


def _kept(check: Check) -> str:
    if check.point is not None and check.point.failed:
        return ", ".join(check.point.failures)
    if check.times <= 1:
        return "kept"
    return f"within {TOLERATED:g} times" if check.tolerated else "BROKEN"


def _worst(bar: ErrorBar | None) -> str:
    return NOTHING if bar is None else compact(bar.high)


def _part(bar: ErrorBar | None, target: float) -> str:
    return NOTHING if bar is None else compact(bar.high / target)


def _error(error: float) -> str:
    return compact(error) if math.isfinite(error) else NOTHING


# -- sentences --------------------------------------------------------------------------------------------------


def sentences(result: TuneResult) -> list[str]:
    """What was searched, against what, and how far the result goes; or that there is none."""
    tuning = result.tuning
    lines = [result.command, *_about(tuning)]
    if tuning.choice is None:
        return [*lines, f"{tuning.why_not}."]
    if tuning.runner_up is None:
        lines.append(f"no other method holds within {FAR_DEARER:g} times the work")
    lines += [line for check in result.checks if (line := check_line(check))]
    return [*lines, _limits(tuning)]


def _about(tuning: Tuning) -> list[str]:
    agreement = tuning.reference.agreement.get(tuning.norm, 0.0)
    apart = ""
    if agreement:
        apart = f" ({tuning.norm}: {compact(agreement)} apart, which what was tried and the margin add to their errors)"
    units = "" if tuning.scale == 1 else f", {compact(tuning.target * tuning.scale)} in the scene's units"
    repeated = f" in {tuning.repeats} {tuning.repeated}" if tuning.repeats > 1 else ""
    return [
        f"{tuning.norm}: {tuning.text}",
        f"reference: {tuning.reference.text}{apart}",
        f"target: {target_text(tuning.target, tuning.norm)}{units}, over {number(tuning.seconds)} s{repeated}",
        f"{counted(tuning.methods, 'method')} to choose from, {counted(len(tuning.trials), 'trial')};"
        " the cheapest first",
    ]


def check_line(check: Check) -> str:
    """A warning for a scene that was not tuned on; empty if the promise was kept."""
    if check.refused:
        return f"{check.scene}: not measured: {check.refused}"
    if check.tolerated:
        return ""
    if math.isinf(check.error):
        return f"{check.scene}: THE PROMISE IS BROKEN: the choice fails there"
    return (
        f"{check.scene}: THE PROMISE IS BROKEN: {check.norm} {compact(check.error)}, {compact(check.times)} times what"
        " was promised: the choice does not carry over, tune on that scene too"
    )


def _limits(tuning: Tuning) -> str:
    return (
        f"measured on {tuning.scene} over {number(tuning.seconds)} s and nowhere else: larger speeds, stronger forces, "
        "other sizes or longer runs change the error; --check SCENE measures it there"
    )
