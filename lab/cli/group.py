"""The click groups of the ``carom`` command and its subcommands: errors of one line."""

from __future__ import annotations

import importlib
import os
import sys
from typing import Any

import click

STOPPED = 130  # exit code after Ctrl-C


class Commands(click.Group):
    """A click group whose errors are one line on stderr, and exit code 2; without arguments its help."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args and self.no_args_is_help:  # click takes it for an error
            click.echo(ctx.get_help())
            ctx.exit()
        return super().parse_args(ctx, args)

    def main(self, *args: Any, **options: Any) -> Any:
        options["standalone_mode"] = False
        traceback_wanted = "--traceback" in (options.get("args") or sys.argv[1:])
        try:
            result = super().main(*args, **options)
        except click.exceptions.Abort:
            click.echo("carom: stopped", err=True)
            result = STOPPED
        except click.ClickException as error:
            if traceback_wanted:
                raise
            click.echo(f"carom: {' '.join(error.format_message().split())}", err=True)
            sys.exit(2)
        if result == STOPPED:  # what a Ctrl-C left of a compiler may crash the interpreter as it takes that down
            sys.stdout.flush()
            os._exit(STOPPED)
        sys.exit(result if isinstance(result, int) else 0)


class LateCommands(Commands):
    """Commands that are imported when they are called: help and errors of the group need none of them.

    late: by name, where it is in this package, ``module:name``, and its line in the help
    """

    def __init__(self, *args: Any, late: dict[str, tuple[str, str]], **options: Any) -> None:
        super().__init__(*args, **options)
        self.late = late

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(self.late)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in self.late and cmd_name not in self.commands:
            module, _, name = self.late[cmd_name][0].partition(":")
            self.add_command(getattr(importlib.import_module(f"..{module}", __package__), name), cmd_name)
        return super().get_command(ctx, cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, self.late[name][1]) for name in self.list_commands(ctx)])
