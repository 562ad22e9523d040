"""A library out of kernels, for one platform."""

from __future__ import annotations

import dataclasses
import json
import multiprocessing
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from pathlib import Path

from carom import __version__

from ...framework.jit.hash import PYTHON, writing_digest
from ...framework.jit.libraries import AVX2, LAYOUT, NAME
from .glue import Entry, glue
from .kernels import BuiltKernel
from .linker import link
from .objects import assemble, retarget
from .platforms import Platform


def build_library(
    kernels: Sequence[BuiltKernel], output: Path, platform: Platform, compared: bool,
    wide: Sequence[BuiltKernel] = (),
) -> None:  # fmt: skip
    """Write the library; BuildError if the machine cannot link for that platform.

    compared
        it stands beside sources that may change: it holds the hashes of what it was made from
    wide
        some of the kernels as they are for processors with AVX2, which take these; with the same bits
    """
    objects = _objects(kernels, platform, {kernel.symbol: kernel.symbol for kernel in kernels})
    entries = [
        Entry(kernel.symbol, kernel.symbol, kernel.arguments, kernel.result)
        for kernel in kernels if kernel.arguments is not None
    ]  # fmt: skip
    addresses = {kernel.symbol: kernel.symbol for kernel in kernels if kernel.arguments is None}
    symbols = {kernel.symbol: kernel.symbol + AVX2 for kernel in wide}
    objects += _objects(wide, platform.with_avx2, symbols)
    addresses |= {symbol: symbol for symbol in symbols.values()}
    hashes = {kernel.symbol: kernel.hash for kernel in kernels} if compared else {}
    facts = {
        "layout": LAYOUT, "carom": __version__, "python": PYTHON, "writing": writing_digest(),
        "hashes": json.dumps(hashes), "features": platform.features,
    }  # fmt: skip
    link([*objects, assemble(glue(NAME, entries, addresses, facts, platform), platform)], output, platform)


def _objects(kernels: Sequence[BuiltKernel], platform: Platform, symbols: Mapping[str, str]) -> list[bytes]:
    """An object file of each kernel, on all processors. symbols: their names there, by those they have."""
    if not kernels:
        return []
    bare = dataclasses.replace(platform)  # without LLVM's part of it, which stays in its process
    exported = [{kernel.compiled_as: symbols[kernel.symbol]} for kernel in kernels]
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        bitcodes = (kernel.bitcode for kernel in kernels)
        return [*pool.map(retarget, bitcodes, repeat(bare), exported, chunksize=8)]
