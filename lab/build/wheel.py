"""carom's own wheels, with the kernels of all that ships: ``python -m carom.lab.build.wheel FOLDER [PLATFORM]...``.

In a checkout; see ``make wheel`` and ``make wheels``.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import carom

from ...framework.jit.library import NAME, platform_name
from .kernels import collect
from .library import build_library
from .platforms import PLATFORMS, Platform

PACKAGE = Path(carom.__file__).parent
ROOT = PACKAGE.parents[1]
TAG = "CAROM_WHEEL"  # in the environment of setup.py: the platform's tag


def own(platform: Platform) -> Path:
    """Where carom's own library is."""
    return PACKAGE / f"{NAME}{platform.suffix}"


def make_wheels(folder: Path, names: Sequence[str]) -> None:
    """A wheel for each of these platforms, into that folder."""
    kernels = collect((), "generic", everything=True)
    for platform in [PLATFORMS[name] for name in names]:
        library = own(platform)
        try:
            build_library(kernels, library, platform, compared=False)
            print(f"{platform.name}: {len(kernels)} kernels, {library.stat().st_size / 1e6:.2f} MB", flush=True)
            options = ["--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", str(folder)]
            command = ["-m", "pip", "--disable-pip-version-check", "wheel", *options, str(ROOT)]
            environment = {**os.environ, TAG: platform.wheel_tag}
            subprocess.run([sys.executable, *command], env=environment, check=True)
        finally:
            library.unlink(missing_ok=True)


if __name__ == "__main__":
    make_wheels(Path(sys.argv[1]), sys.argv[2:] or [platform_name()])
