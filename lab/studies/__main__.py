"""``python -m carom.lab.studies NAME``: measure again what a table of the docs shows."""

from __future__ import annotations

import click

from ..cli.group import LateCommand, LateCommands
from ..cli.main import in_command

COMMANDS = {
    "accuracy": LateCommand(
        "studies.accuracy.command:accuracy_command", "What speed costs in accuracy, in scenes with a known answer."
    ),
    "geometry": LateCommand(
        "studies.geometry.command:geometry_command", "False positives and cost of levels of collision geometry."
    ),
    "ladder": LateCommand("studies.bench.command:ladder_command", "What each feature costs, switched on alone."),
    "limits": LateCommand("studies.limits.command:limits_command", "Where carom fails, one axis at a time or two."),
    "modes": LateCommand("studies.bench.command:modes_command", "What each kind of collision costs, and what it buys."),
    "page": LateCommand("studies.page:page_command", "Put what a carom command prints into a page."),
    "plugin-pairs": LateCommand(
        "studies.bench.command:pairs_command", "What a pair of a plugin costs, next to a built-in one and by hand."
    ),
    "promises": LateCommand("studies.promises:promises_command", "What trade and tune promise, measured again."),
    "scaling": LateCommand("studies.bench.command:scaling_command", "How the time per body grows with their number."),
    "settings": LateCommand(
        "studies.settings.command:settings_command",
        "What each field of Settings costs and buys; settings for kinds of games.",
    ),
    "startup": LateCommand("studies.bench.command:startup_command", "The time to the first step of a new process."),
    "stages": LateCommand(
        "studies.stages:stages_command", "List the stages of a step: what each reads and writes, where its code is."
    ),
}


@click.group(cls=LateCommands, late=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
def cli() -> None:
    """Studies that regenerate the tables and charts of carom's docs."""


if __name__ == "__main__":
    in_command(cli)
