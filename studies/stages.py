"""Every stage of a step, from the list that the engine itself runs."""

from __future__ import annotations

from pathlib import Path

import click

from carom.framework.schedule.stages import Stage
from carom.lab.reporting.text_tables import TextTable
from carom.systems.stage_list import CLOSING, ON_DEMAND, OPENING, SYSTEMS

from .page import PageOutput, shown_options

OPENS, CLOSES, DEMANDED = "start of the step", "end of the step", "on demand"


@click.command("stages", short_help="List the stages of a step: what each reads and writes, where its code is.")
@shown_options
def stages_command(as_json: bool, as_markdown: bool, into: Path | None) -> None:
    """List all stages of a step in their order. A scene runs those that it needs: ``carom plan`` shows which."""
    output = PageOutput.of("studies stages", as_json, as_markdown, into)
    listed = Stages()
    output.show(listed, [listed.table()], [])


class Stages:
    """The stages by the system they belong to."""

    def __init__(self) -> None:
        self.groups: dict[str, tuple[Stage, ...]] = {
            OPENS: OPENING,
            **{system.__name__: system.STAGES for system in SYSTEMS},
            CLOSES: CLOSING,
            DEMANDED: ON_DEMAND,
        }

    def as_dict(self) -> dict[str, list[dict[str, object]]]:
        """The same as data, for JSON."""
        return {
            group: [
                {
                    "stage": stage.name, "what": stage.why, "needed": stage.needed, "when": stage.when,
                    "reads": stage.reads, "writes": stage.writes, "file": _file(stage),
                }
                for stage in stages
            ]
            for group, stages in self.groups.items()
        }  # fmt: skip

    def table(self) -> TextTable:
        """One row for each stage."""
        headings = ("system", "stage", "what it does", "linked for", "reads", "writes", "code")
        rows = [
            (group, stage.name, _what(stage), stage.needed or "every world",
             ", ".join(stage.reads), ", ".join(stage.writes), _file(stage))
            for group, stages in self.groups.items()
            for stage in stages
        ]  # fmt: skip
        return TextTable("The stages of a step, in order", headings, rows, words=len(headings))


def _what(stage: Stage) -> str:
    return f"{stage.why} (when {stage.when})" if stage.when else stage.why


def _file(stage: Stage) -> str:
    return stage.function.__module__.removeprefix("carom.").replace(".", "/") + ".py"
