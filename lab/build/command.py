"""``carom build``: the kernels of a game, or of all that ships with carom, as one library per platform."""

from __future__ import annotations

import subprocess
from pathlib import Path

import click

import carom

from ...framework.jit.library import NAME, file_name, platform_name
from ..cli.options import traceback_option
from ..cli.usage_errors import Problem
from .errors import BuildError
from .kernels import collect
from .library import build_library
from .platforms import PLATFORMS


@click.command("build", short_help="Build a game's kernels into a library, for players without a compiler.")
@click.argument("games", metavar="[FILE.py]...", nargs=-1)
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), metavar="FOLDER",
    help="Where the libraries go, one file per platform, for use_kernels(FOLDER); else kernels beside the first file.",
)
@click.option(
    "--platform", "names", multiple=True, type=click.Choice([*PLATFORMS]), help="For which machines; else for this one."
)
@traceback_option
def build_command(games: tuple[str, ...], out: Path | None, names: tuple[str, ...]) -> None:
    """Compile all kernels that worlds of these files may call and carom's own library lacks.

    Without files: all that ships with carom, into carom's own folder. In a checkout, what is not edited then compiles
    no more.
    """
    if not games and (out or names):
        raise Problem("--out and --platform are for a game: name its file")
    platforms = [PLATFORMS.get(name) for name in names or (platform_name(),)]
    if None in platforms:
        raise Problem(f"carom builds for {', '.join(PLATFORMS)}; this machine is {platform_name()}")
    try:
        kernels = collect(games, "generic", everything=not games)
        for platform in platforms:
            assert platform is not None
            if games:
                path = (out or Path(games[0]).parent / "kernels") / file_name(platform.name)
            else:
                path = Path(carom.__file__).parent / f"{NAME}{platform.suffix}"
            build_library(kernels, path, platform, compared=True)
            click.echo(f"{path}: {len(kernels)} kernels, {path.stat().st_size / 1e6:.2f} MB")
    except subprocess.CalledProcessError as error:
        raise click.exceptions.Exit(error.returncode) from None
    except BuildError as error:
        raise Problem(str(error)) from error
