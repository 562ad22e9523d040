"""A game as a page: a folder with all that a browser needs but Pyodide, for machines that compile nothing.

There is no compiler on a page, so one library holds all kernels that worlds of the game may call, carom's own and those
of the game: it is ``carom._kernels`` there, as in a wheel.
"""

from __future__ import annotations

import json
import re
import shutil
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path

import esper

import carom

from ...framework.jit.libraries import NAME
from ..cli.loading import load
from .build_library import build_library
from .errors import BuildError
from .kernels import BuiltKernel
from .platforms import PLATFORMS

PLATFORM = PLATFORMS["wasm32"]
ABIS = tuple(re.findall(r"\d{4}_\d", PLATFORM.wheel_tag))  # of Pyodide, one after the other

_WEB, _PACKAGE = Path(__file__).with_name("web"), Path(carom.__file__).parent
# The lab is no part of a game; cameras, lists to draw and maps need nothing that a page lacks.
_ROOMS = ("framework", "components", "systems", "plugins", "drawing", "maps", "view", "scenes")


def files_of(games: Sequence[str]) -> dict[str, Path]:
    """The files of these games and the modules beside them that they import, by their names on the page.

    BuildError for a name that something else has there; Problem if a game does not load.
    """
    files: dict[str, Path] = {}
    for game in games:
        loaded = load(game)
        if loaded.file is None or loaded.siblings is None:
            raise BuildError(f"{game} is a scene of carom's own: a page is made of a file")
        with closing(loaded.build(None, {}, 0)):  # imports what it needs
            own = {file.relative_to(loaded.siblings.folder): file for file in loaded.siblings.files}
        for name, file in {Path(loaded.file.name): loaded.file, **own}.items():
            if name.parts[0].removesuffix(".py") in ("carom", "esper", "numpy", "carom_page"):
                raise BuildError(f"{file}: a page has another module of that name; rename it")
            if files.setdefault(name.as_posix(), file) != file:
                raise BuildError(f"{file} and {files[name.as_posix()]} cannot both be on a page; rename one")
    return files


def files_added(added: Sequence[Path], game: Path, files: dict[str, Path]) -> None:
    """Add what a game reads: files, and all that folders hold, under their names from the game's folder on.

    BuildError for what is not there, or elsewhere.
    """
    for path in added:
        if not path.exists():
            raise BuildError(f"--add {path}: there is no such file or folder")
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if not file.resolve().is_relative_to(game.parent):
                raise BuildError(f"--add {file}: it is not in the game's folder, {game.parent}, or a folder in that")
            if file.is_file():
                files.setdefault(file.resolve().relative_to(game.parent).as_posix(), file)


def build_page(kernels: Sequence[BuiltKernel], files: Mapping[str, Path], folder: Path, pyodide: str) -> None:
    """Write the page; the first file is its game.

    pyodide
        URL of the folder that holds Pyodide, relative to the page or not

    Raises BuildError if nothing here links for WebAssembly.
    """
    with tempfile.TemporaryDirectory() as scratch:
        library = Path(scratch, f"{NAME}{PLATFORM.suffix}")
        build_library(kernels, library, PLATFORM, compared=False)
        folder.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(folder / "game.zip", "w") as archive:
            for name, file in {**dict(_sources()), **files, f"carom/{library.name}": library}.items():
                entry = zipfile.ZipInfo(name)  # without a date: the same files make the same page
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, file.read_bytes(), zipfile.ZIP_DEFLATED, compresslevel=9)
    for name in ("index.html", "loader.mjs", "run.mjs"):
        shutil.copyfile(_WEB / name, folder / name)
    game = Path(next(iter(files))).stem
    page = {"game": game, "pyodide": f"{pyodide.rstrip('/')}/", "abis": ABIS}
    (folder / "page.json").write_text(json.dumps(page, indent=2) + "\n", encoding="utf-8")


def _sources() -> Iterator[tuple[str, Path]]:
    yield "carom_page.py", _WEB / "carom_page.py"
    yield "esper/__init__.py", Path(esper.__file__)
    yield "carom/__init__.py", _PACKAGE / "__init__.py"
    for room in _ROOMS:
        for file in sorted((_PACKAGE / room).rglob("*.py")):
            yield f"carom/{file.relative_to(_PACKAGE).as_posix()}", file
