"""The click group of the ``carom`` command and its subcommands: one-line errors with suggestions."""

from __future__ import annotations

import sys
from typing import Any

import click

from .usage_errors import Problem, did_you_mean

STOPPED = 130  # exit code after Ctrl-C


class Commands(click.Group):
    """A click group whose errors are one line on stderr, with suggestions, and exit code 2."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0] if args else ""
        if name and not name.startswith("-") and self.get_command(ctx, name) is None:
            raise Problem(f"no command {name!r}{did_you_mean(name, self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)

    def main(self, *args: Any, **options: Any) -> Any:
        options["standalone_mode"] = False
        traceback_wanted = "--traceback" in (options.get("args") or sys.argv[1:])
        try:
            result = super().main(*args, **options)
        except click.exceptions.Abort:
            click.echo("carom: stopped", err=True)
            sys.exit(STOPPED)
        except click.ClickException as error:
            if traceback_wanted:
                raise
            click.echo(f"carom: {' '.join(error.format_message().split())}", err=True)
            sys.exit(2)
        sys.exit(result if isinstance(result, int) else 0)
