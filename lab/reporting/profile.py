"""``carom run --profile``: the time of a step by system and kernel, as plain values and as a table."""

from __future__ import annotations

import math
from typing import Any

from rich.table import Table

from ...framework.schedule.profile_report import SINGULAR, Stats

UNITS = tuple(SINGULAR.values())  # body, candidate, pair, contact


def profile_of(stats: Stats, step_milliseconds: float, compile_seconds: float) -> dict[str, Any]:
    """Mean times per step by system, in order, and by kernel within it, with the share of the whole step.

    The time of a system outside its kernels is Python and numpy. Steps that compiled or loaded kernels, which took
    ``compile_seconds``, are excluded.
    """

    def share(mean: float) -> float:
        return mean / step_milliseconds if step_milliseconds > 0 else math.nan

    systems: list[dict[str, Any]] = []
    for name, measured in stats.milliseconds.items():
        mean = measured if stats.steps else math.nan
        kernels = [
            {
                "kernel": row.kernel,
                "calls": row.calls,
                "milliseconds": row.milliseconds,
                "share": share(row.milliseconds),
                "nanoseconds_per": row.nanoseconds,
            }
            for row in stats.kernels
            if row.system == name
        ]
        rest = mean - sum(row["milliseconds"] for row in kernels)
        systems.append(
            {
                "system": name,
                "milliseconds": mean,
                "share": share(mean),
                "nanoseconds_per": stats.nanoseconds[name],
                "python_milliseconds": rest,
                "kernels": kernels,
            }
        )
    rest = step_milliseconds - stats.total
    return {
        "steps": stats.steps,
        "compile_seconds": compile_seconds,
        "systems": systems,
        "everything_else_milliseconds": rest,
    }


def profile_table(profile: dict[str, Any], step_milliseconds: float) -> Table:
    """Time per step by system and by kernel, with calls per step and time per piece of work."""
    table = Table(title="time per step", title_justify="left", title_style="bold", box=None, padding=(0, 1, 0, 0))
    table.add_column("system, kernel", no_wrap=True)
    for heading in ("ms per\nstep", "\nshare", "calls\na step", *(f"ns per\n{unit}" for unit in UNITS)):
        table.add_column(heading, justify="right", no_wrap=True)
    for system in profile["systems"]:
        table.add_row(system["system"], *_timing(system), style="bold")
        for kernel in system["kernels"]:
            table.add_row(f"  {kernel['kernel']}", *_timing(kernel))
        if system["kernels"]:
            table.add_row("  Python and numpy", milliseconds(system["python_milliseconds"]), style="dim")
    table.add_row("everything else", milliseconds(profile["everything_else_milliseconds"]), style="bold")
    table.add_section()
    table.add_row("whole step (mean)", milliseconds(step_milliseconds), style="bold")
    return table


def _timing(row: dict[str, Any]) -> list[str]:
    share, per = row["share"], row["nanoseconds_per"]
    return [
        milliseconds(row["milliseconds"]),
        f"{100 * share:.0f} %" if math.isfinite(share) else "",
        f"{row['calls']:.2f}" if "calls" in row else "",
        *(_nanoseconds(per[unit]) if unit in per else "" for unit in UNITS),
    ]


def _nanoseconds(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.1f}"


def milliseconds(value: float) -> str:
    """A dash for a value that was not measured, because every step compiled or loaded kernels."""
    return f"{max(value, 0.0):.4f}" if math.isfinite(value) else "-"
