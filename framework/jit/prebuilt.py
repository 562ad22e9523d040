"""Folders of machine code that came with carom or with a game, made for any processor of a platform.

Such a folder holds files like those of the cache (:mod:`cache`) and an index that names what they were made with: the
versions of Python, numba, llvmlite and numpy, the platform and the kind of processor. Machine code for another version
is of no use, so a folder whose index differs is left alone, with one line in the log, and kernels compile as usual.
"""

from __future__ import annotations

import json
import logging
import os
import sysconfig
from dataclasses import dataclass
from functools import cache
from pathlib import Path

INDEX = "index.json"
PORTABLE = ("generic", "")  # name and features of a processor whose code runs on all of a platform
OFF = "CAROM_PREBUILT"  # 0 in the environment: compile everything here

logger = logging.getLogger("carom")


@dataclass(frozen=True)
class Prebuilt:
    """A folder whose code runs here; processor: name and features it was made for."""

    path: Path
    processor: tuple[str, str]


def made_with() -> dict[str, str]:
    """What an index must say for its code to run here."""
    from .hash import toolchain  # loads numba

    return {**toolchain(), "platform": sysconfig.get_platform()}


_added: list[Path] = []


def use_kernels(folder: str | os.PathLike[str]) -> None:
    """Load kernels from that folder, too: what ``carom warm-up --portable FOLDER`` has made, for a game or a plugin.

    What is missing there, or was made with other versions, compiles as usual; one line in the log says so.
    """
    path = Path(folder).absolute()
    if path not in _added:
        _added.append(path)


def folders() -> list[Prebuilt]:
    """All that can be used, carom's own first."""
    if os.environ.get(OFF, "") == "0":
        return []
    own = Path(__file__).resolve().parent.parent / "prebuilt"
    found = [_opened(path) for path in ([own] if own.is_dir() else []) + _added]
    return [folder for folder in found if folder is not None]


@cache
def _opened(path: Path) -> Prebuilt | None:
    """The folder if its code runs here; else None, after a line in the log that says why it does not."""
    try:
        index = json.loads((path / INDEX).read_text(encoding="utf-8"))
        expected = made_with()
        found = {name: index["made_with"][name] for name in expected}
        processor = (str(index["processor"][0]), str(index["processor"][1]))
    except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
        logger.warning("carom: the kernels in %s are not used: %s is missing or damaged (%s)", path, INDEX, error)
        return None
    other = [f"{name} {found[name]}, here {expected[name]}" for name in expected if found[name] != expected[name]]
    if other:
        logger.warning("carom: the kernels in %s are not used, they were made with %s", path, "; ".join(other))
        return None
    return Prebuilt(path, processor)


def write_index(path: Path, processor: tuple[str, str]) -> None:
    """Say in the folder what its kernels were made with."""
    text = json.dumps({"made_with": made_with(), "processor": list(processor)}, indent=2)
    (path / INDEX).write_text(text + "\n", encoding="utf-8")
