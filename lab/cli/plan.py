"""``carom plan``: the systems and kernels of a scene's step, and why they run; ``carom scenes``: the library."""

from __future__ import annotations

from typing import Any

import click

from ... import scenes
from ...framework import Settings
from ..plugins.command import plugin_named
from ..reporting.text import TextTable
from .loading import load, stdout_kept_clean
from .options import traceback_option, world_options


@click.command("plan", short_help="Show what a step of a scene runs, and why.")
@click.argument("target", metavar="SCENE|FILE.py")
@world_options
@traceback_option
def plan_command(
    target: str, settings: Settings | None, changes: dict[str, Any], seed: int, plugins: tuple[str, ...]
) -> None:
    """Build a scene of the library, or of a file that defines build(settings, seed=0), and print its plan."""
    loaded = load(target)
    world = loaded.build(settings, changes, seed, [plugin_named(name) for name in plugins])
    with loaded.attribute_errors(), stdout_kept_clean():
        plan = str(world.plan())
    click.echo(plan)


@click.command("scenes", short_help="List the scenes of the library.")
def scenes_command() -> None:
    """List the scenes of the library."""
    known = map(scenes.get, scenes.names())
    rows = [(scene.name, f"{scene.dimensions}D", f"{scene.seconds:g}", scene.description) for scene in known]
    TextTable("", ("scene", "", "seconds", "what it is"), rows, left=(3,)).show()
