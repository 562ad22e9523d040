"""``python -m studies.site``: build the site into build/docs/site; exit code 1 if anything in it is wrong."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import click

from .check import findings
from .live import add_buttons, build_live
from .pages import ROOT, copy_pages, write_settings

INTO = ROOT / "build" / "docs"


@click.command()
@click.option("--live", metavar="PYODIDE", help="Scenes run in pages: a folder with Pyodide and numpy, or its URL.")
def main(live: str | None) -> None:
    """Build the site into build/docs/site, and look at every link in it."""
    shutil.rmtree(INTO, ignore_errors=True)
    INTO.mkdir(parents=True)
    copy_pages(INTO / "pages")
    if live is not None:
        add_buttons(INTO / "pages")
    write_settings(INTO, ["live.js"] if live is not None else [])
    builder = Path(sys.executable).with_name("zensical")
    done = subprocess.run([builder, "build", "--strict", "--config-file", INTO / "mkdocs.yml"], cwd=ROOT)
    if done.returncode:
        sys.exit(done.returncode)
    site = INTO / "site"
    found = findings(site)
    if live is not None:
        build_live(INTO / "live", site / "live", live)
    for line in found:
        click.echo(line, err=True)
    sizes = [page.stat().st_size for page in site.rglob("*.html")]
    click.echo(f"{site}: {len(sizes)} pages, the text of the largest {max(sizes) / 1000:.0f} KB")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
