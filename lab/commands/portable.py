"""``carom warm-up --portable FOLDER``: kernels for any processor of this platform, to ship with a game or a plugin."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import click

from ...framework.jit.cache import CACHE_FOLDER_VARIABLE, KERNELS
from ...framework.jit.prebuilt import INDEX, OFF, PORTABLE, write_index
from .usage_errors import Problem


def compile_portable(folder: Path, arguments: Sequence[str]) -> None:
    """Compile what ``carom warm-up ARGUMENTS`` compiles, for any processor, into that folder; replace what it held."""
    if folder.exists() and (not folder.is_dir() or (any(folder.iterdir()) and not (folder / INDEX).exists())):
        raise Problem(f"{folder} holds other things: name a new folder for the kernels, or one made by --portable")
    with tempfile.TemporaryDirectory(prefix="carom-portable-") as cache:
        # numba decides for a processor when it is imported: another process.
        environment = {
            **os.environ, CACHE_FOLDER_VARIABLE: cache, OFF: "0",
            "NUMBA_CPU_NAME": PORTABLE[0], "NUMBA_CPU_FEATURES": PORTABLE[1],
        }  # fmt: skip
        done = subprocess.run([sys.executable, "-m", "carom", "warm-up", *arguments], env=environment)
        if done.returncode:
            raise click.exceptions.Exit(done.returncode)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        files = sorted(Path(cache).glob(KERNELS))
        for file in files:
            shutil.copyfile(file, folder / file.name)
    write_index(folder, PORTABLE)
    size = sum(file.stat().st_size for file in folder.iterdir())
    click.echo(f"{folder}: {len(files):,} kernels for any processor of this platform, {size / 1e6:.1f} MB")
