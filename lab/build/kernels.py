"""The kernels of a library: compiled, or loaded from the cache, for any processor of a family.

numba decides for which processor it compiles when it is imported, so that is done in a process of its own.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from ...framework.compilation import Compiled, log
from ...framework.jit.lazy import dispatchers
from ...framework.jit.library import OFF, short_hash
from ...framework.jit.link_all import link_all
from ...framework.jit.linkable import Linkable
from ...systems.linking.preparation import all_functions
from ..cli.loading import load
from ..cli.warm_up import STEPS, shipped_kernels


@dataclass(frozen=True)
class BuiltKernel:
    """One function.

    symbol
        its name in the library
    name
        of the Python function
    compiled_as
        its name in ``bitcode``, a module in LLVM's language
    arguments
        int64 or float64 each, of one that Python calls; None: it is called by its address
    hash
        of the code it was made from
    """

    symbol: str
    name: str
    compiled_as: str
    bitcode: bytes
    arguments: tuple[str, ...] | None
    hash: str


def linked_kernels() -> list[BuiltKernel]:
    """All that this process has linked, in an order that is always the same."""
    found = []
    for symbol, (function, made) in sorted(dispatchers.linked.items()):
        assert function.signature is not None
        arguments = tuple(kind.name for kind in function.signature.arguments)
        found.append(BuiltKernel(
            symbol, function.py_func.__name__, made.fndesc.llvm_func_name,
            made.library._get_module_for_linking().as_bitcode(),
            arguments if isinstance(function, Compiled) else None, short_hash(function.py_func),
        ))  # fmt: skip
    return found


def collect(targets: Iterable[str], processor: str, everything: bool) -> list[BuiltKernel]:
    """What worlds of these files may call, of all that ships without any, for such processors: a name that LLVM knows,
    as generic.

    everything
        also what carom's own library has

    subprocess.CalledProcessError if that process fails; it has told why.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "kernels"
        environment = {**os.environ, "NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""}
        if everything:
            environment[OFF] = "0"
        code = f"from {__name__} import write; write()"
        subprocess.run([sys.executable, "-c", code, str(path), *targets], env=environment, check=True)
        return pickle.loads(path.read_bytes())


def prepare(targets: Sequence[str]) -> None:
    """Link all that worlds of these files may call that no library has; of all that ships, if there are none."""
    functions: dict[Linkable, None] = {}
    for target in targets:
        loaded = load(target)
        with closing(loaded.build(None, {}, 0)) as world, loaded.attribute_errors():
            dimensions = world.dimensions
            assert dimensions is not None  # a file without physics is no game, see load
            functions.update(dict.fromkeys(all_functions(world.registry, dimensions)))
            world.prepare()
            for _ in range(STEPS):
                world.step()
    if not targets:
        for dimensions in (2, 3):
            functions.update(dict.fromkeys(shipped_kernels(dimensions)))
    link_all(functions)


def write() -> None:
    """What that process does."""
    log.processes, log.background = os.cpu_count() or 1, False
    prepare(sys.argv[2:])
    Path(sys.argv[1]).write_bytes(pickle.dumps(linked_kernels()))
