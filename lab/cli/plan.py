"""``carom plan``: the systems and kernels of a scene's step, and why they run."""

from __future__ import annotations

import click

from ..plugins.installed import plugin_named
from .choices import parse_assignments, preset
from .loading import load, stdout_kept_clean
from .options import plugin_option, seed_number, seed_option, set_option, settings_option


@click.command("plan", short_help="Show what a step of a scene runs, and why.")
@click.argument("target", metavar="SCENE|FILE.py")
@settings_option
@set_option
@seed_option
@plugin_option
@click.option("--traceback", is_flag=True, help="Show in full where an error came from.")
def plan_command(
    target: str,
    preset_name: str | None,
    assignments: tuple[str, ...],
    seed: str,
    plugins: tuple[str, ...],
    traceback: bool,
) -> None:
    """Build a scene of the library, or of a file that defines build(settings, seed=0), and print its plan."""
    del traceback  # seen by Commands.main
    settings = preset(preset_name) if preset_name is not None else None
    changes = parse_assignments(assignments)
    loaded = load(target)
    number = seed_number(seed)
    world = loaded.build(settings, changes, number, [plugin_named(name) for name in plugins])
    with loaded.attribute_errors(), stdout_kept_clean():
        plan = str(world.plan())
    click.echo(plan)
