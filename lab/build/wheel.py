"""carom's own wheels, with the kernels of all that ships: ``python -m carom.lab.build.wheel FOLDER [PLATFORM]...``.

In a checkout; see ``make wheel`` and ``make wheels``.
"""

from __future__ import annotations

import base64
import hashlib
import itertools
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import carom

from ...framework.jit.libraries import NAME, platform_name
from .build_library import build_library
from .kernels import WIDE_PROCESSOR, collect
from .platforms import PLATFORMS, Platform

ROOT = Path(carom.__file__).parents[2]
# The loops over all bodies, pairs and contacts: with vectors of four numbers they make steps 5 to 20 % faster.
WIDE = (
    "box_motions", "check_flight", "compare_contacts", "evaluate_pairs", "find_resting", "order_candidates",
    "place_moving", "resolve_impacts", "search_uniform_grid", "select_pairs", "solve_contacts", "solve_joined_range",
    "solve_turning_contacts",
)  # fmt: skip


def make_wheels(folder: Path, names: Sequence[str]) -> None:
    """A wheel for each of these platforms, into that folder: the pure one with a library in it."""
    kernels = collect((), "generic", everything=True)
    platforms = [PLATFORMS[name] for name in names]
    any_wide = any(platform.is_x86 for platform in platforms)
    wide = collect((), WIDE_PROCESSOR, everything=True, names=WIDE) if any_wide else []
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        options = ["--quiet", "--disable-pip-version-check", "--no-deps", "--wheel-dir", temporary]
        subprocess.run([sys.executable, "-m", "pip", "wheel", *options, str(ROOT)], check=True)
        (pure,) = Path(temporary).glob("*.whl")
        for platform in platforms:
            library = Path(temporary, f"{NAME}{platform.suffix}")
            build_library(kernels, library, platform, compared=False, wide=wide if platform.is_x86 else ())
            made = with_library(pure, library, platform, folder)
            print(f"{made}: {len(kernels)} kernels, {made.stat().st_size / 1e6:.2f} MB", flush=True)


def with_library(pure: Path, library: Path, platform: Platform, folder: Path) -> Path:
    """Write the wheel that has all of a pure one, and the library beside carom's own modules."""
    name, version, *_ = pure.name.split("-")
    information = f"{name}-{version}.dist-info"
    with zipfile.ZipFile(pure) as archive:
        files = {file: archive.read(file) for file in archive.namelist()}
    del files[f"{information}/RECORD"]
    files[f"{name}/{library.name}"] = library.read_bytes()
    files[f"{information}/WHEEL"] = _description(platform).encode()
    lines = [f"{file},sha256={_digest(content)},{len(content)}\n" for file, content in files.items()]
    files[f"{information}/RECORD"] = f"{''.join(lines)}{information}/RECORD,,\n".encode()
    made = folder / f"{name}-{version}-{platform.python}-{platform.wheel_tag}.whl"
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for file, content in files.items():
            entry = zipfile.ZipInfo(file)  # of no time: the same files are the same wheel
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o100644 << 16
            archive.writestr(entry, content)
    return made


def _description(platform: Platform) -> str:
    tags = itertools.product(*(part.split(".") for part in (*platform.python.split("-"), platform.wheel_tag)))
    lines = ["Wheel-Version: 1.0", "Generator: carom", "Root-Is-Purelib: false", *(f"Tag: {'-'.join(t)}" for t in tags)]
    return "\n".join(lines) + "\n"


def _digest(content: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()


if __name__ == "__main__":
    make_wheels(Path(sys.argv[1]), sys.argv[2:] or [platform_name()])
