"""``carom scenes``: the scenes of the library."""

from __future__ import annotations

import click

from ... import scenes
from ..reporting.text import TextTable


@click.command("scenes", short_help="List the scenes of the library.")
def scenes_command() -> None:
    """List the scenes of the library."""
    known = map(scenes.get, scenes.names())
    rows = [(scene.name, f"{scene.dimensions}D", f"{scene.seconds:g}", scene.description) for scene in known]
    TextTable("", ("scene", "", "seconds", "what it is"), rows, left=(3,)).show()
