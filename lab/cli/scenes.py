"""``carom scenes``: the scenes of the library."""

from __future__ import annotations

import click
from rich.console import Console
from rich.table import Table

from ... import scenes


@click.command("scenes", short_help="List the scenes of the library.")
def scenes_command() -> None:
    """List the scenes of the library."""
    table = Table(box=None, pad_edge=False)
    table.add_column("scene", style="bold")
    table.add_column("", justify="right")
    table.add_column("seconds", justify="right")
    table.add_column("what it is")
    for name in scenes.names():
        scene = scenes.get(name)
        table.add_row(name, f"{scene.dimensions}D", f"{scene.seconds:g}", scene.description)
    Console().print(table)
