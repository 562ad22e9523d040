"""The results of a run as terminal tables; the JSON output has the same numbers."""

from __future__ import annotations

import math
import re

import numpy as np
from rich.console import Console

from ...framework.schedule.profile_report import Stats
from ..measure.run import Drift, RunReport
from .text import NOTHING, TextTable, counted, number

WARNING = "bold yellow"
FAULTS_SHOWN = 3
AT_REST = 1e-2  # of the energy: a smaller kinetic energy is no scale for a drift


def print_report(report: RunReport, console: Console, profile: Stats | None = None) -> None:
    """Print the tables: settings, cost by system, the profile by kernel if there is one, and accuracy."""
    console.print(f"\n{summary(report)}\n", highlight=False, markup=False)
    cost(report).show()
    console.print()
    if profile is not None:
        console.print(f"{profile}\n", highlight=False, markup=False, soft_wrap=True)
        console.print(f"not in it: {report.compile_seconds:.3g} s for the steps that compiled or loaded kernels\n")
    quality(report).show()
    for line in fault_lines(report.faults):
        console.print(f"! {line}", style=WARNING, highlight=False)


def fault_lines(faults: list[str]) -> list[str]:
    """A line for each kind of fault, with the first entities that have it."""
    kinds: dict[str, list[str]] = {}
    for fault in faults:
        entity, what = re.fullmatch(r"(?:entity (\d+): )?(.*)", fault, re.DOTALL).groups()  # type: ignore[union-attr]
        kinds.setdefault(what, []).extend([entity] * (entity is not None))
    lines = []
    for what, entities in list(kinds.items())[:FAULTS_SHOWN]:
        more = f" and {len(entities) - FAULTS_SHOWN:,} more" * (len(entities) > FAULTS_SHOWN)
        word, each = ("entity", "") if len(entities) == 1 else ("entities", ", each")
        lines.append(f"{word} {', '.join(entities[:FAULTS_SHOWN])}{more}{each}: {what}" if entities else what)
    others = len(kinds) - len(lines)
    return [*lines, f"and {counted(others, 'other fault')}"] if others else lines


def summary(report: RunReport) -> str:
    """Bodies, steps, times and the choice of settings, in three lines."""
    kinds = [f"{report.bodies[kind]:,} {kind}" for kind in ("dynamic", "kinematic", "static") if report.bodies[kind]]
    choice = [f"{name} {report.settings[name]}" for name in ("integrator", "collision", "substeps")]
    took = f"{report.simulated_seconds:.4g} s in {report.wall_seconds:.3g} s"
    kernels = report.kernels_compiled or report.kernels_loaded
    if kernels:
        doing = "compiling" if report.kernels_compiled else "loading"
        took += f" ({report.compile_seconds:.3g} s of it {doing} {counted(kernels, 'kernel')})"
    return "\n".join([
        f"{report.scene}  {report.dimensions}D, {', '.join(kinds) or 'no bodies'}",
        f"{counted(report.steps, 'step')} of {number(report.settings['dt'])} s = {took}",
        f"{', '.join(choice)}, seed {report.seed}",
    ])  # fmt: skip


def cost(report: RunReport) -> TextTable:
    """Milliseconds per step by system; a dash where every step compiled or loaded kernels."""
    total = report.step_milliseconds_mean
    rest = total - sum(report.system_milliseconds.values())
    rows = []
    for name, mean in {**report.system_milliseconds, "everything else": rest, "whole step (mean)": total}.items():
        share = f"{100 * mean / total:.0f} %" if total > 0 else ""
        rows.append((name, f"{max(mean, 0.0):.4f}" if math.isfinite(mean) else NOTHING, share))
    return TextTable("time per step", ("system", "ms per step", "share"), rows)


def quality(report: RunReport) -> TextTable:
    """Contacts, drift, overlap, escapes."""
    contacts = report.contacts
    per_step = f"at the end; {contacts['mean']:.4g} per step, at most {contacts['most']:,}"
    bounced = "in all" if contacts["impacts"] or not contacts["most"] else "nothing bounced"
    rows = [
        ("bodies", f"{report.bodies['total']:,}", ""),
        ("contacts", f"{contacts['end']:,}", per_step),
        ("impacts", f"{contacts['impacts']:,}", bounced),
    ]
    if report.energy:
        rows.append(_energy_row(report.energy, report.energy_changes))
    if report.momentum and not math.isfinite(report.momentum.relative):
        rows.append(("momentum drift", "not representable", "momentum overflows"))
    elif report.momentum and report.momentum_conserved:
        remark = _drift_remark(report.momentum, "all mass times speed")
        rows.append(("momentum drift", f"{100 * report.momentum.relative:.3g} %", remark))
    step = f"in step {report.deepest_overlap_step:,}" if report.deepest_overlap_step else ""
    rows.append(("deepest overlap", f"{report.deepest_overlap:.4g}", step))
    outside, broken = report.escaped["outside"], report.escaped["non_finite"]
    parts = [f"{outside:,} beyond the walls"] * bool(outside) + [f"{broken:,} not finite"] * bool(broken)
    rows.append(("escaped bodies", f"{outside + broken:,}", ", ".join(parts)))
    for name, values in report.compared.items():
        place = ", ".join(f"{value:.4g}" for value in values)
        rows.append((name, "none" if any(map(math.isnan, values)) else f"({place})" if len(values) > 1 else place, ""))
    return TextTable("what happened", ("", "", ""), rows, left=(2,))


def _energy_row(energy: Drift, changes: list[str]) -> tuple[str, str, str]:
    """Of an energy that changes by intent from what to what; else the drift."""
    if not math.isfinite(energy.relative):
        return "energy", "not representable", "energy overflows"
    if changes:
        return "energy", f"{energy.start:.3g} to {energy.end:.3g} J", f"changed by {', '.join(changes)}"
    if energy.scale < AT_REST * np.abs(energy.start):
        return "energy", f"{energy.end:.3g} J", "as at the start"
    return "energy drift", f"{100 * energy.relative:+.3g} %", _drift_remark(energy, "peak kinetic energy")


def _drift_remark(drift: Drift, scale: str) -> str:
    return f"of {scale}; at worst {100 * drift.worst:.3g} %"
