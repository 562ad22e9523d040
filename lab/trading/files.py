"""A trade as files for other programs: JSON, which converts back to records, and CSV."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
from collections.abc import Iterator
from pathlib import Path

from ..cli.usage_errors import Problem
from ..engines.adapters import WEIGHTS
from .records import CaseTrade, Curve, Point, Trade

COLUMNS: dict[str, str] = {
    "scene": "its name, or the file's",
    "target": "what the command line called it",
    "kind": "smooth, impacts, resting or chaotic",
    "seconds": "simulated, s",
    "method": "the curve's label",
    "engine": "carom or pymunk",
    "integrator": "",
    "collision": "",
    "substeps": "of the solver; of pymunk its iterations",
    "geometry": "",
    "dt": "step, s",
    "norm": "what the error is the error of",
    "error": "mean over the repeats that did not fail; relative, but for norms with a unit; empty if all failed",
    "error_low": "the least of them",
    "error_high": "the largest of them",
    "error_uncertainty": "standard error of the mean",
    "trusted": "1 if the reference is exact enough to tell this error, else 0",
    "order": "observed, of the whole curve; empty if there is none",
    "theory": "the order that theory gives; exact: rounding only; empty if nobody knows",
    "repeats": "how many there were",
    "failed": "kind and number of those that failed, as tunnelled 3; escaped 1",
    "work": "weighted sum of the counts, per simulated second",
    **dict.fromkeys(WEIGHTS, "per simulated second"),
    "wall_ms": "median wall time per simulated second, ms; empty if it was not timed",
    "wall_ms_low": "the least",
    "wall_ms_high": "the largest",
}


def write_json(trade: Trade, path: Path) -> Path:
    """Write everything as JSON; ``Trade.from_dict(json.loads(...))`` reads it. Problem if the file cannot be
    written."""
    return _write(path, json.dumps(trade.as_dict(), indent=1, allow_nan=False) + "\n")


def write_csv(trade: Trade, path: Path) -> Path:
    """Write one row per point and norm, with COLUMNS. Problem if the file cannot be written."""
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, list(COLUMNS), lineterminator="\n")
    writer.writeheader()
    for case in trade.cases:
        for curve in case.curves:
            for point in curve.points:
                writer.writerows(_rows(case, curve, point))
    return _write(path, buffer.getvalue())


def _rows(case: CaseTrade, curve: Curve, point: Point) -> Iterator[dict[str, object]]:
    of_point = {
        **{name: getattr(case, name) for name in ("scene", "target", "kind", "seconds")},
        "method": curve.label,
        **dataclasses.asdict(point.cell),
        "repeats": point.repeats,
        "failed": "; ".join(f"{kind} {count}" for kind, count in point.failures.items() if count),
        "work": point.work,
        **{name: point.counts.get(name) for name in WEIGHTS},
    }
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
