"""``carom warm-up --portable FOLDER``: kernels for any processor of this platform, to ship with a game or a plugin."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from ...framework.jit.cache import used
from ...framework.jit.prebuilt import INDEX, OFF, PORTABLE, write_index
from .usage_errors import Problem

COPY = "CAROM_COPY_USED"  # in the environment of the process that compiles: where copies go


def compile_portable(folder: Path, arguments: Sequence[str]) -> None:
    """Put what ``carom warm-up ARGUMENTS`` needs, for any processor, into that folder; replace what it held.

    What the cache folder holds already, made for any processor, is not compiled again.
    """
    if folder.exists() and (not folder.is_dir() or (any(folder.iterdir()) and not (folder / INDEX).exists())):
        raise Problem(f"{folder} holds other things: name a new folder for the kernels, or one made by --portable")
    # numba decides for a processor when it is imported: another process.
    environment = {
        **os.environ, COPY: str(folder.absolute()), OFF: "0",
        "NUMBA_CPU_NAME": PORTABLE[0], "NUMBA_CPU_FEATURES": PORTABLE[1],
    }  # fmt: skip
    done = subprocess.run([sys.executable, "-m", "carom", "warm-up", *arguments], env=environment)
    if done.returncode:
        raise click.exceptions.Exit(done.returncode)
    write_index(folder, PORTABLE)
    sizes = [file.stat().st_size for file in folder.iterdir()]
    size = f"{sum(sizes) / 1e6:.1f} MB"
    click.echo(f"{folder}: {len(sizes) - 1:,} kernels for any processor of this platform, {size}")


def copy_used() -> None:
    """In the process that compiles: leave copies of all kernels that were needed."""
    wanted = os.environ.get(COPY)
    if wanted:
        shutil.rmtree(wanted, ignore_errors=True)
        os.makedirs(wanted)
        for file in sorted(used):
            shutil.copyfile(file, os.path.join(wanted, file.name))
