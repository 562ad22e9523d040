"""The ``carom`` command: each of its commands is in a module of its own, imported when it is called."""

from __future__ import annotations

import os
import warnings

import click

from carom import __version__

from ...framework.compilation import log
from ...framework.errors import PhysicsWarning
from .group import LateCommands

# By name: where it is, and its line in the help.
COMMANDS = {
    "build": ("build.command:build_command", "Build a game's kernels into a library."),
    "limits": ("limits.command:limits_command", "How long a scene's step may be, and what limits it."),
    "maps": ("cli.maps:maps_command", "Check maps of Tiled and LDtk."),
    "plan": ("cli.plan:plan_command", "Show what a step of a scene runs, and why."),
    "plugins": ("plugins.command:plugins_command", "List plugins, or check one."),
    "run": ("cli.run:run_command", "Run a scene or a file and show what happened."),
    "scenes": ("cli.plan:scenes_command", "List the scenes of the library."),
    "trade": ("trading.command:trade_command", "What speed costs in accuracy, and which settings to use."),
    "warm-up": ("cli.warm_up:warm_up_command", "Compile ahead, so that the first run does not wait."),
}


@click.group(cls=LateCommands, late=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="carom")
def cli() -> None:
    """carom: a physics framework for games, from the command line."""


def main() -> None:
    """The entry point of the ``carom`` script and of ``python -m carom``."""
    in_command(cli)


def in_command(command: click.Command) -> None:
    """Run the command of this process: kernels compile on all cores, and faults are in the results."""
    log.processes, log.background = os.cpu_count() or 1, False
    warnings.simplefilter("ignore", PhysicsWarning)  # commands show world.faults in their results
    command()
