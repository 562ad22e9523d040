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


@click.command("stages", short_help="List the stages of a step: what each reads and writes, where its code is.")
@into_option
def stages_command(into: Path | None) -> None:
    """List all stages of a step in their order. A scene runs those that it needs: ``carom plan`` shows which."""
    if into is None:
        click.echo(table().markdown())
    else:
        replace_between_marks(into, "studies stages", table().markdown())


def file_of(stage: Stage) -> str:
    """Where its code is."""
    return stage.function.__module__.removeprefix("carom.").replace(".", "/") + ".py"


def table() -> TextTable:
    """One row for each stage."""
    headings = ("system", "stage", "what it does", "linked for", "reads", "writes", "code")
    rows = [
        (group, stage.name, f"{stage.why} (when {stage.when})" if stage.when else stage.why,
         stage.needed or "every world", ", ".join(stage.reads), ", ".join(stage.writes), file_of(stage))
        for group, stages in GROUPS.items()
        for stage in stages
    ]  # fmt: skip
    return TextTable("The stages of a step, in order", headings, rows, words=len(headings))
