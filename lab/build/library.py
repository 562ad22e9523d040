"""A library out of kernels, for one platform."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from carom import __version__

from ...framework.jit.hash import PYTHON
from ...framework.jit.library import LAYOUT, NAME
from .glue import Entry, glue
from .kernels import BuiltKernel
from .linker import link
from .objects import assemble, retarget
from .platforms import Platform


def build_library(kernels: Sequence[BuiltKernel], output: Path, platform: Platform, compared: bool) -> None:
    """Write the library; BuildError if the machine cannot link for that platform.

    compared
        it stands beside sources that may change: it holds the hashes of what it was made from
    """
    objects = [retarget(kernel.bitcode, platform, {kernel.compiled_as: kernel.symbol}) for kernel in kernels]
    entries = [
        Entry(kernel.symbol, kernel.symbol, kernel.arguments, kernel.result)
        for kernel in kernels if kernel.arguments is not None
    ]  # fmt: skip
    addresses = {kernel.symbol: kernel.symbol for kernel in kernels if kernel.arguments is None}
    hashes = {kernel.symbol: kernel.hash for kernel in kernels} if compared else {}
    facts = {"layout": LAYOUT, "carom": __version__, "python": PYTHON, "hashes": json.dumps(hashes)}
    link([*objects, assemble(glue(NAME, entries, addresses, facts, platform), platform)], output, platform)
