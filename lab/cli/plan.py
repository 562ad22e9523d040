"""``carom plan``: the systems and kernels of a scene's step, and why they run."""

from __future__ import annotations

from typing import Any

import click

from ...framework import Settings
from ..plugins.installed import plugin_named
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
