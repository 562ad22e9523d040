"""Tables on the terminal, and in pages of the docs: between two comments that name the command which writes them."""

from __future__ import annotations

from pathlib import Path

import click

from carom.lab.cli.usage_errors import Problem
from carom.lab.reporting.output import show_tables
from carom.lab.reporting.text import TextTable, as_markdown

into_option = click.option(
    "--into", type=click.Path(path_type=Path, dir_okay=False), help="Put the tables between the marks of this page."
)


def show(tables: list[TextTable], remarks: list[str], into: Path | None, mark: str) -> None:
    """Print the tables, and write them into the page, the remarks as a list."""
    show_tables(tables, remarks)
    if into is not None:
        listed = ["\n".join(f"- {remark}" for remark in remarks)] if remarks else []
        replace_between_marks(into, mark, as_markdown(tables, listed))
        click.echo(f"tables: {into}", err=True)


def between_marks(path: Path, name: str) -> tuple[str, str, str]:
    """A page up to the comment ``<!-- name -->``, to ``<!-- end of name -->`` and after; Problem if one is missing."""
    first, last = f"<!-- {name} -->", f"<!-- end of {name} -->"
    try:
        page = path.read_text(encoding="utf-8")
    except OSError as error:
        raise Problem(f"--into {path}: {error.strerror or error}") from error
    before, mark, rest = page.partition(first)
    inside, end, after = rest.partition(last)
    if not (mark and end):
        raise Problem(f"--into {path}: it has no line {first} with a line {last} after it")
    return before + mark, inside, end + after


def replace_between_marks(path: Path, name: str, text: str) -> None:
    """Replace the text between the two comments of a page; Problem if they are missing."""
    before, _, after = between_marks(path, name)
    path.write_text(f"{before}\n\n{text}\n\n{after}", encoding="utf-8")


def with_a_palette(picture: Path) -> None:
    """Write a chart again with 128 colours, which look the same: a third of the bytes, for pages with many."""
    from PIL import Image

    image = Image.open(picture).convert("RGB")
    image.quantize(128, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(picture, optimize=True)
