"""``carom build``: the kernels of a game, or of all that ships with carom, as one library per platform."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click

import carom

from ...framework.jit.libraries import NAME, file_name, has_avx2, platform_name
from ..cli.options import traceback_option
from ..cli.usage_errors import Problem
from .build_library import build_library
from .errors import BuildError
from .kernels import WIDE_PROCESSOR, collect
from .linker import linker_for
from .page import PLATFORM as WEB
from .page import build_page, files_added, files_of
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
@click.option(
    "--web", type=click.Path(path_type=Path, file_okay=False), metavar="FOLDER",
    help="Make a page of the first file there, with all kernels that worlds of all files need.",
)
@click.option(
    "--add", "added", multiple=True, type=click.Path(path_type=Path), metavar="PATH",
    help="For a page: a file or a folder that the game reads, such as a map with its images; once each.",
)  # fmt: skip
@click.option("--pyodide", metavar="URL", help="Where the page finds Pyodide with numpy; else pyodide beside it.")
@traceback_option
def build_command(
    games: tuple[str, ...], out: Path | None, names: tuple[str, ...], web: Path | None, added: tuple[Path, ...],
    pyodide: str | None,
) -> None:  # fmt: skip
    """Compile all kernels that worlds of these files may call and carom's own library lacks.

    Without files: all that ships with carom, for this machine, into carom's own folder. In a checkout, what is not
    edited then compiles no more.
    """
    if not games and (out or names):
        raise Problem("--out and --platform are for a game: name its file")
    if web is not None and (out or names or not games):
        raise Problem("--web makes a page of a game: name its file, without --out and --platform")
    if pyodide is not None and web is None:
        raise Problem("--pyodide is for a page: --web FOLDER")
    if added and web is None:
        raise Problem("--add is for a page: --web FOLDER; a packed folder gets its files by the packer")
    if web is not None:
        with _told():
            _page(games, web, added, pyodide or "pyodide")
        return
    if not names and platform_name() not in PLATFORMS:
        raise Problem(f"carom builds for {', '.join(PLATFORMS)}; this machine is {platform_name()}")
    platforms = [PLATFORMS[name] for name in names or (platform_name(),)]
    with _told():
        for platform in platforms:
            linker_for(platform)  # before anything compiles
        wide = not games and platforms[0].is_x86 and has_avx2()
        kernels = collect(games, WIDE_PROCESSOR if wide else "generic", everything=not games)
        for platform in platforms:
            if games:
                path = (out or Path(games[0]).parent / "kernels") / file_name(platform.name)
            else:
                path = Path(carom.__file__).parent / f"{NAME}{platform.suffix}"
            build_library(kernels, path, platform.with_avx2 if wide else platform, compared=True)
            click.echo(f"{path}: {len(kernels)} kernels, {path.stat().st_size / 1e6:.2f} MB")


def _page(games: tuple[str, ...], folder: Path, added: tuple[Path, ...], pyodide: str) -> None:
    linker_for(WEB)  # before anything compiles
    files = files_of(games)
    files_added(added, next(iter(files.values())).resolve(), files)
    kernels = collect(games, "generic", everything=True)
    build_page(kernels, files, folder, pyodide)
    size = sum(file.stat().st_size for file in folder.iterdir() if file.is_file())
    click.echo(f"{folder / 'index.html'}: {len(kernels)} kernels, {size / 1e6:.2f} MB beside Pyodide")


@contextmanager
def _told() -> Iterator[None]:
    """What stops a build is told in a line."""
    try:
        yield
    except subprocess.CalledProcessError as error:
        raise click.exceptions.Exit(error.returncode) from None
    except BuildError as error:
        raise Problem(str(error)) from error
