"""The results of a run as terminal tables; the JSON output has the same numbers."""

from __future__ import annotations

import math
import re

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ...framework.schedule.profile_report import Stats
from ..measure.run import Drift, RunReport
from ..wording import counted, number

GOOD, WARNING = "green", "bold yellow"
FAULTS_SHOWN = 3
AT_REST = 1e-2  # of the energy: a smaller kinetic energy is no scale for a drift


def print_report(report: RunReport, console: Console, profile: Stats | None = None) -> None:
    """Print the tables: settings, cost by system, the profile by kernel if there is one, and accuracy."""
    console.print()
    console.print(summary(report))
    console.print(cost(report))
    if profile is not None:
        console.print(f"{profile}\n", highlight=False, markup=False, soft_wrap=True)
        console.print(f"not in it: {report.compile_seconds:.3g} s for the steps that compiled or loaded kernels\n")
    console.print(quality(report))
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


def summary(report: RunReport) -> Text:
    kinds = [f"{report.bodies[kind]:,} {kind}" for kind in ("dynamic", "kinematic", "static") if report.bodies[kind]]
    choice = {k: report.settings[k] for k in ("integrator", "collision", "substeps") if k in report.settings}
    text = Text()
    text.append(report.scene, style="bold")
    text.append(f"  {report.dimensions}D, {', '.join(kinds) or 'no bodies'}\n")
    text.append(
        f"{counted(report.steps, 'step')} of {number(report.settings['dt'])} s = {report.simulated_seconds:.4g} s"
        f" in {report.wall_seconds:.3g} s"
    )
    if report.kernels_compiled:
        text.append(f" ({report.compile_seconds:.3g} s of it compiling {counted(report.kernels_compiled, 'kernel')})")
    elif report.kernels_loaded:
        text.append(f" ({report.compile_seconds:.3g} s of it loading {counted(report.kernels_loaded, 'kernel')})")
    text.append(f"\n{', '.join(f'{name} {value}' for name, value in choice.items())}, seed {report.seed}\n")
    return text


def milliseconds(value: float) -> str:
    """A dash for a value that was not measured, because every step compiled or loaded kernels."""
    return f"{max(value, 0.0):.4f}" if math.isfinite(value) else "-"


def cost(report: RunReport) -> Table:
    """Milliseconds per step by system."""
    table = Table(title="time per step", title_justify="left", title_style="bold")
    table.add_column("system")
    table.add_column("ms per step", justify="right")
    table.add_column("share", justify="right")
    total = report.step_milliseconds_mean
    rest = total - sum(report.system_milliseconds.values())
    for name, mean in {**report.system_milliseconds, "everything else": rest}.items():
        share = f"{100 * mean / total:.0f} %" if total > 0 else ""
        table.add_row(name, milliseconds(mean), share)
    table.add_section()
    table.add_row("whole step (mean)", milliseconds(total), "", style="bold")
    return table


def quality(report: RunReport) -> Table:
    """Contacts, drift, overlap, escapes."""
    table = Table(title="what happened", title_justify="left", title_style="bold", show_header=False)
    table.add_column("quantity")
    table.add_column("value", justify="right")
    table.add_column("remark", style="dim")
    contacts = report.contacts
    table.add_row("bodies", f"{report.bodies['total']:,}", "")
    table.add_row(
        "contacts",
        f"{contacts['end']:,}",
        f"at the end; {contacts['mean']:.4g} per step, at most {contacts['most']:,}",
    )
    bounced = "in all" if contacts["impacts"] or not contacts["most"] else "nothing bounced"
    table.add_row("impacts", f"{contacts['impacts']:,}", bounced)
    if report.energy:
        table.add_row(*_energy_row(report.energy, report.energy_changes))
    if report.momentum and not math.isfinite(report.momentum.relative):
        table.add_row("momentum drift", "not representable", "momentum overflows")
    elif report.momentum and report.momentum_conserved:
        remark = _drift_remark(report.momentum, "all mass times speed")
        table.add_row("momentum drift", f"{100 * report.momentum.relative:.3g} %", remark)
    step = f"in step {report.deepest_overlap_step:,}" if report.deepest_overlap_step else ""
    table.add_row("deepest overlap", f"{report.deepest_overlap:.4g}", step)
    outside, broken = report.escaped["outside"], report.escaped["non_finite"]
    parts = [f"{outside:,} beyond the walls"] * bool(outside) + [f"{broken:,} not finite"] * bool(broken)
    table.add_row("escaped bodies", f"{outside + broken:,}", ", ".join(parts), style=WARNING if parts else GOOD)
    for name, values in report.compared.items():
        place = ", ".join(f"{value:.4g}" for value in values)
        table.add_row(name, "none" if any(map(math.isnan, values)) else f"({place})" if len(values) > 1 else place, "")
    return table


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
