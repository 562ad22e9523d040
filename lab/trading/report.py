"""A trade of accuracy for speed as tables and sentences: every point and its cost."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
from collections.abc import Iterator
from pathlib import Path

from ..bench.report import machine_line
from ..cli.usage_errors import Problem
from ..engines.adapters import WEIGHTS
from ..measure.norms import MEAN
from ..reporting.text import NOTHING, TextTable, compact, number
from .records import TRUSTED, CaseTrade, Curve, ErrorBar, Point, Reference, Trade

ENERGY_SQUARE, ERROR_UNIT = "energy_square", "J²"  # the norm that has a unit
DOUBTED = "*"  # marks an error that is too close to the reference's own


def tables(trade: Trade, norm: str | None = None) -> list[TextTable]:
    """A table of all points for each case.

    ``norm``: used for cases that have it; the others use their first one.
    """
    return [points_table(case, norm_of(case, norm)) for case in measured(trade)]


def measured(trade: Trade) -> list[CaseTrade]:
    """The cases that were not refused."""
    return [case for case in trade.cases if not case.refused]


def norm_of(case: CaseTrade, norm: str | None) -> str:
    """``norm`` if the case has it, or its mean over the seeds; else its first."""
    return next((name for name in (norm, f"{MEAN}{norm}") if name in case.norms and name is not None), case.norm)


def points_table(case: CaseTrade, norm: str) -> TextTable:
    """One row per point; columns without information are left out."""
    points = case.points
    bars = [point.errors[norm] for point in points if norm in point.errors]
    worst = any(bar.high > bar.mean for bar in bars)
    timed = any(point.milliseconds for point in points)
    failing = any(point.failed for point in points)
    headings = ["method", "order", "step, s", error_heading(norm), *[worst_heading(case.reference, norm)] * worst]
    headings += ["work", *["wall ms"] * timed, *["failed"] * failing]
    rows = []
    for curve in case.curves:
        for place, point in enumerate(curve.points):
            bar = point.errors.get(norm)
            row = [curve.label, "" if place else order(curve, norm), number(point.cell.dt), _error(case, norm, bar)]
            row += [compact(bar.high) if bar else NOTHING] * worst
            row += [compact(point.work)]
            row += [compact(point.milliseconds.median) if point.milliseconds else NOTHING] * timed
            row += [failures(point)] * failing
            rows.append(tuple(row))
    title = f"{case.scene}: {norm}, and work per simulated second"
    return TextTable(title, tuple(headings), rows)


def error_heading(norm: str) -> str:
    return f"error, {ERROR_UNIT}" if norm == ENERGY_SQUARE else "error"


def worst_heading(reference: Reference, norm: str) -> str:
    return "mean + 2 s.e." if reference.is_statistic(norm) else "worst"


def _error(case: CaseTrade, norm: str, bar: ErrorBar | None) -> str:
    """The mean, its standard error if there is one, and a mark if the reference is not more accurate."""
    if bar is None:
        return NOTHING
    text = f"{compact(bar.mean)} ± {compact(bar.uncertainty, 1)}" if bar.uncertainty else compact(bar.mean)
    return text if case.reference.trusts(norm, bar.mean) else f"{text} {DOUBTED}"


def order(curve: Curve, norm: str) -> str:
    """The observed order and, in brackets, the theoretical one: `2.01 (2)`; `(exact)` if only rounding is left."""
    found, theory = curve.orders.get(norm), curve.theory.get(norm)
    if theory == math.inf:
        return "(exact)"
    text = NOTHING if found is None else f"{found:.2f}"
    return text if theory is None else f"{text} ({theory:g})"


def failures(point: Point) -> str:
    """`tunnelled` if all repeats did, else `3 of 64 tunnelled`; empty if none failed."""
    words = [
        kind if count == point.repeats else f"{count} of {point.repeats} {kind}"
        for kind, count in point.failures.items()
        if count
    ]
    return ", ".join(words)


def remarks(trade: Trade) -> list[str]:
    """The machine and, for each case, what was measured, against what, and how reliable it is."""
    lines = [machine_line(trade.machine), trade.command]
    for case in trade.cases:
        lines += [f"{case.scene}: {line}" for line in case_remarks(case, case.norm)]
    return lines


def case_remarks(case: CaseTrade, norm: str) -> list[str]:
    """Sentences about one case, for the norm that its table shows."""
    lines = [f"{case.kind}: {case.why}"]
    if case.refused:
        return [*lines, f"not measured: {case.refused}"]
    repeated = f", {case.repeats} {case.repeated}" if case.repeats > 1 else ""
    lines.append(f"{number(case.seconds)} s simulated{repeated}")
    lines.append(f"{norm}: {case.norms[norm]}")
    agreement = case.reference.agreement.get(norm, 0.0)
    apart = f" ({norm}: {compact(agreement)} apart)" if agreement else ""
    lines.append(f"reference: {case.reference.text}{apart}")
    known = [point.errors[norm].mean for point in case.points if norm in point.errors]
    doubted = [error for error in known if not case.reference.trusts(norm, error)]
    if doubted:
        limit = TRUSTED * case.reference.agreement[norm]
        lines.append(
            f"{DOUBTED} {len(doubted)} of the errors {'is' if len(doubted) == 1 else 'are'} below {compact(limit)},"
            f" {TRUSTED:g} times what the references differ by: too small to be told from the reference's own"
        )
    return lines


# -- files for other programs ----------------------------------------------------------------------------


# Scene and point; the error in the norm: mean, least, largest and standard error of the mean over the repeats that did
# not fail; whether the reference can tell it; the order observed and in theory ("exact": rounding only); what failed,
# as in "tunnelled 3; escaped 1"; per simulated second the work, what it counts, and the wall time in ms.
COLUMNS = (
    "scene", "target", "kind", "seconds", "method", "engine", "integrator", "collision", "substeps", "geometry", "dt",
    "norm", "error", "error_low", "error_high", "error_uncertainty", "trusted", "order", "theory", "repeats", "failed",
    "work", *WEIGHTS, "wall_ms", "wall_ms_low", "wall_ms_high",
)  # fmt: skip


def write_json(trade: Trade, path: Path) -> Path:
    """Write everything as JSON; ``Trade.from_dict(json.loads(...))`` reads it. Problem if the file cannot be
    written."""
    return _write(path, json.dumps(trade.as_dict(), indent=1, allow_nan=False) + "\n")


def write_csv(trade: Trade, path: Path) -> Path:
    """Write one row per point and norm, with COLUMNS. Problem if the file cannot be written."""
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, COLUMNS, lineterminator="\n")
    writer.writeheader()
    for case in trade.cases:
        for curve in case.curves:
            for point in curve.points:
                writer.writerows(_rows(case, curve, point))
    return _write(path, buffer.getvalue())


def _rows(case: CaseTrade, curve: Curve, point: Point) -> Iterator[dict[str, object]]:
    of_point = {
        **{name: getattr(case, name) for name in ("scene", "target", "kind", "seconds")}, "method": curve.label,
        **dataclasses.asdict(point.cell), "repeats": point.repeats, "work": point.work,
        "failed": "; ".join(f"{kind} {count}" for kind, count in point.failures.items() if count),
        **{name: point.counts.get(name) for name in WEIGHTS},
    }  # fmt: skip
    if point.milliseconds:
        time = point.milliseconds
        of_point |= {"wall_ms": time.median, "wall_ms_low": time.low, "wall_ms_high": time.high}
    for norm in case.norms:
        theory = curve.theory.get(norm)
        row = {**of_point, "norm": norm, "order": curve.orders.get(norm)}
        row["theory"] = "exact" if theory == math.inf else theory
        if norm in point.errors:
            bar = dataclasses.asdict(point.errors[norm])
            row |= {"error": bar.pop("mean"), **{f"error_{name}": value for name, value in bar.items()}}
            row["trusted"] = int(case.reference.trusts(norm, row["error"]))
        yield row


def _write(path: Path, text: str) -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise Problem(f"{path}: {error.strerror or error}") from error
    return path
