"""The results of a run as terminal tables; the JSON output has the same numbers."""

from __future__ import annotations

import math

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..measure.run import Drift, RunReport
from .profile import milliseconds, profile_table

GOOD, WARNING = "green", "bold yellow"
FAULTS_SHOWN = 3


def print_report(report: RunReport, console: Console) -> None:
    """Print the tables: settings, cost by system, and accuracy."""
    console.print()
    console.print(summary(report))
    if report.profile is None:
        console.print(cost(report))
    else:
        console.print(profile_table(report.profile, report.step_milliseconds_mean))
        console.print(f"not in it: {report.compile_seconds:.3g} s for the steps that compiled or loaded kernels\n")
    console.print(quality(report))
    for fault in report.faults[:FAULTS_SHOWN]:
        console.print(f"! {fault}", style=WARNING, highlight=False)
    if len(report.faults) > FAULTS_SHOWN:
        console.print(
            f"! and {len(report.faults) - FAULTS_SHOWN:,} more of the kind", style=WARNING, highlight=False
        )


def summary(report: RunReport) -> Text:
    kinds = [
        f"{report.bodies[kind]:,} {kind}"
        for kind in ("dynamic", "kinematic", "static")
        if report.bodies[kind]
    ]
    choice = {k: report.settings[k] for k in ("integrator", "collision", "substeps") if k in report.settings}
    text = Text()
    text.append(report.scene, style="bold")
    text.append(f"  {report.dimensions}D, {', '.join(kinds) or 'no bodies'}\n")
    text.append(
        f"{report.steps:,} step{'s' * (report.steps != 1)}"
        f" of {number(report.settings['dt'])} s = {report.simulated_seconds:.4g} s"
        f" in {report.wall_seconds:.3g} s"
    )
    if report.kernels_compiled:
        text.append(f" ({report.compile_seconds:.3g} s of it compiling {report.kernels_compiled} kernels)")
    elif report.kernels_loaded:
        text.append(f" ({report.compile_seconds:.3g} s of it loading {report.kernels_loaded} kernels)")
    text.append(f"\n{', '.join(f'{name} {value}' for name, value in choice.items())}, seed {report.seed}\n")
    return text


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
    table.add_row("impacts", f"{contacts['impacts']:,}", "in all")
    if report.energy:
        kept = not report.energy_changes and math.isfinite(report.energy.relative)
        name, value = ("energy drift", _percent(report.energy)) if kept else ("energy", _from_to(report.energy))
        table.add_row(name, value, _energy_remark(report))
    if report.momentum and not math.isfinite(report.momentum.relative):
        table.add_row("momentum drift", "not representable", "momentum overflows")
    elif report.momentum and report.momentum_conserved:
        remark = _drift_remark(report.momentum, "all mass times speed")
        table.add_row("momentum drift", f"{100 * report.momentum.relative:.3g} %", remark)
    step = f"in step {report.deepest_overlap_step:,}" if report.deepest_overlap_step else ""
    table.add_row("deepest overlap", f"{report.deepest_overlap:.4g}", step)
    outside, broken = report.escaped["outside"], report.escaped["non_finite"]
    parts = [f"{outside:,} beyond the walls"] * bool(outside) + [f"{broken:,} not finite"] * bool(broken)
    table.add_row(
        "escaped bodies", f"{outside + broken:,}", ", ".join(parts), style=WARNING if parts else GOOD
    )
    for name, values in report.compared.items():
        place = ", ".join(f"{value:.4g}" for value in values)
        table.add_row(name, "none" if any(map(math.isnan, values)) else f"({place})" if len(values) > 1 else place, "")
    return table


def number(value: float) -> str:
    """Four digits, and 1/60 if the value is exactly that."""
    if (
        0 < value < 1
        and abs(1 / value - round(1 / value)) < 1e-9 * round(1 / value)
        and round(1 / value) > 10
    ):
        return f"1/{round(1 / value)}"
    return f"{value:.4g}"


def _energy_remark(report: RunReport) -> str:
    if report.energy is None or not math.isfinite(report.energy.relative):
        return "energy overflows"
    if report.energy_changes:
        return f"changed by {', '.join(report.energy_changes)}"
    return _drift_remark(report.energy, "peak kinetic energy")


def _from_to(drift: Drift) -> str:
    """Of an energy that changes by intent."""
    if not math.isfinite(drift.relative):
        return "not representable"
    return f"{drift.start:.3g} to {drift.end:.3g} J"


def _percent(drift: Drift) -> str:
    if not math.isfinite(drift.relative):
        return "not representable"
    return f"{100 * drift.relative:+.3g} %"


def _drift_remark(drift: Drift, scale: str) -> str:
    return f"of {scale}; at worst {100 * drift.worst:.3g} %"
