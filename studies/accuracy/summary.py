"""A trade in one short table per scene: a row per method, with its orders and the step needed for each target."""

from __future__ import annotations

from collections.abc import Sequence

from carom.lab.reporting.text_tables import TextTable
from carom.lab.trading.records import CaseTrade, Curve, Point
from carom.lab.trading.report import TARGETS, failures, order, target_text
from carom.lab.wording import NOTHING, compact, number


def summary(case: CaseTrade, targets: Sequence[float] = TARGETS) -> TextTable:
    """By method: the observed order of each norm with the theoretical one; for each target the largest step that meets
    it in all repeats, with its work per simulated second; the best error; and the failures."""
    norm = case.norm
    trusted = [target for target in targets if case.reference.trusts(norm, target)]
    headings = ["method", *(f"{name}, order" for name in case.norms), *(target_text(t, norm) for t in trusted), "best"]
    failing = any(point.failed for curve in case.curves for point in curve.points)
    rows = []
    for curve in case.curves:
        row = [curve.label, *(order(curve, name) for name in case.norms)]
        row += [_step(curve, norm, target) for target in trusted]
        row += [_best(curve, norm), *[_failed(curve)] * failing]
        rows.append(tuple(row))
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


def _best(curve: Curve, norm: str) -> str:
    errors = [point.errors[norm].high for point in curve.points if not point.failed and norm in point.errors]
    return compact(min(errors), 2) if errors else NOTHING


def _failed(curve: Curve) -> str:
    """The steps that failed, in words."""
    return "; ".join(f"{number(point.cell.dt)}: {failures(point)}" for point in curve.points if point.failed) or NOTHING
