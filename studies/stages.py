"""Every stage of a step, from the list that the engine itself runs."""

from __future__ import annotations

from pathlib import Path

import click

from carom.framework.schedule.stages import Stage
from carom.lab.reporting.text import TextTable
from carom.systems.stage_list import CLOSING, ON_DEMAND, OPENING, SYSTEMS

from .page import into_option, replace_between_marks

GROUPS: dict[str, tuple[Stage, ...]] = {
    "start of the step": OPENING,
    **{system.__name__: system.STAGES for system in SYSTEMS},
    "end of the step": CLOSING,
    "on demand": ON_DEMAND,
}


@click.command("stages", short_help="List the stages of a step: what each does, and when.")
@into_option
def stages_command(into: Path | None) -> None:
    """List all stages of a step in their order. A scene runs those that it needs: ``carom plan`` shows which."""
    if into is None:
        click.echo(table().markdown())
    else:
        replace_between_marks(into, "studies stages", table().markdown())


def table() -> TextTable:
    """One row for each stage."""
    rows = [
        (group, stage.name, stage.why, ", when ".join(filter(None, (stage.needed or "every world", stage.when))))
        for group, stages in GROUPS.items()
        for stage in stages
    ]
    return TextTable("The stages of a step, in order", ("system", "stage", "what it does", "for"), rows, words=4)
