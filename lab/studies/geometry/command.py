"""Which geometry levels suit which objects."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from ...cli.options import out_option
from ...reporting.progress import Bar
from ..page import PageOutput, repeats_option, shown_options
from . import report as geometry_report
from .study import COUNT, REPEATS, geometry_study


@click.command("geometry", short_help="False positives and cost of levels of collision geometry.")
@click.option(
    "--objects", "count", type=click.IntRange(min=2), default=COUNT, show_default=True, help="How many in a world."
)
@repeats_option(REPEATS, "Timed runs; the median counts.")
@out_option("Draw a picture into this folder.")
@shown_options
def geometry_command(
    count: int, repeats: int, out: Path | None, as_json: bool, as_markdown: bool, into: Path | None
) -> None:
    """Compare spheres, boxes and levels of them around several kinds of objects with the precise shapes.

    How many contacts are reported that are none, how many pairs are tested, and what that costs.
    """
    output = PageOutput.of("studies geometry", as_json, as_markdown, into, out, "studies.geometry.picture")
    with Bar(Console(stderr=True)) as bar:
        result = geometry_study(count, repeats, progress=bar)
    output.show(result, geometry_report.tables(result), geometry_report.remarks(result))
    output.draw("draw_geometry", result)
