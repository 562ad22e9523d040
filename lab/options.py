"""Options that several commands take."""

from __future__ import annotations

import click

from .problems import Problem

settings_option = click.option(
    "--settings", "preset_name", metavar="fast|balanced|accurate", help="Default: what the scene recommends."
)
set_option = click.option(
    "--set", "assignments", multiple=True, metavar="FIELD=VALUE", help="Set one field of Settings; repeatable."
)
seed_option = click.option(
    "--seed", default="0", show_default=True, metavar="NUMBER", help="Which variant of the scene: 0, 1, 2, ..."
)
plugin_option = click.option(
    "--plugin", "plugins", multiple=True, metavar="NAME", help="Add an installed plugin to the world; repeatable."
)


def seed_number(text: str) -> int:
    if not text.strip().isdecimal():
        raise Problem(f"--seed takes a whole number of at least 0, not {text!r}")
    return int(text)
