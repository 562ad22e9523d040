"""Cost and benefit of each field of Settings; the best settings for each kind of game."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from ...cli.options import traceback_option
from ...cli.usage_errors import Problem
from ...reporting.progress import Bar
from ..page import PageOutput, repeats_option, shown_options
from .games import games_study, of_names
from .records import GamesStudy, SettingsStudy
from .report import game_remarks, game_tables, remarks, tables
from .study import REPEATS, of_fields, settings_study

FIELDS_MARK, GAMES_MARK = "studies settings", "studies settings games"


@click.command("settings", short_help="What each field of Settings costs and buys; settings for kinds of games.")
@click.argument("names", metavar="[NAME...]", nargs=-1)
@click.option("--games", is_flag=True, help="Kinds of games instead of fields: the cheapest settings for each.")
@repeats_option(REPEATS, "Timed runs; the median counts.")
@shown_options
@traceback_option
def settings_command(
    names: tuple[str, ...],
    games: bool,
    repeats: int,
    as_json: bool,
    as_markdown: bool,
    into: Path | None,
) -> None:
    """Vary each field of Settings alone, in scenes where it matters: cost and error of its values. About two minutes.

    With --games: tune a scene of each kind of game to what such a game needs. NAMES: only these fields, or games.
    """
    if names and into is not None:
        raise Problem("--into fills the page with all of them: it takes no names")
    (of_names if games else of_fields)(names)  # raises for unknown names before anything runs
    output = PageOutput.of(GAMES_MARK if games else FIELDS_MARK, as_json, as_markdown, into, None)
    found: GamesStudy | SettingsStudy
    with Bar(Console(stderr=True)) as bar:
        if games:
            found = games_study(names or None, repeats, bar)
            shown = game_tables(found), game_remarks(found)
        else:
            found = settings_study(names or None, repeats, bar)
            shown = tables(found), remarks(found)
    output.show(found, *shown)
