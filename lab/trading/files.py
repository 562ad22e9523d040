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
