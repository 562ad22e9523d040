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
from typing import Any

from ...framework.compilation import log
from ...framework.jit.cache import machine_code
from ...framework.jit.kinds import BOOL, FLOAT, INT, NONE, ArrayKind, Kind, array_kind
from ...framework.jit.lazy import dispatchers
from ...framework.jit.libraries import OFF, short_hash
from ...framework.jit.link_all import link_all
from ...framework.jit.linkable import Linkable
from ...framework.jit.names import symbol_of
from ...systems.linking.preparation import all_functions
from ..cli.loading import load
from ..cli.usage_errors import Problem
from ..cli.warm_up import STEPS, shipped_kernels
from .errors import BuildError


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
        int64, float64, bool or address each, of one that Python calls; None: it is called by its address
    result
        int64 or none
    hash
        of the code it was made from
    """

    symbol: str
    name: str
    compiled_as: str
    bitcode: bytes
    arguments: tuple[str, ...] | None
    result: str
    hash: str


def linked_kernels() -> list[BuiltKernel]:
    """All that this process has linked, in an order that is always the same."""
    found = []
    for symbol, (dispatcher, signature, made) in sorted(dispatchers.linked.items()):
        by_address = dispatcher.targetoptions.get("no_cpython_wrapper", False)
        arguments = None if by_address else tuple(kind.name for kind in signature.arguments)
        found.append(_built(symbol, dispatcher.py_func, made, arguments))
    return found


def called_kernels() -> list[BuiltKernel]:
    """Those that have been called with arrays; BuildError for one that cannot be called without numba."""
    found = {}
    for dispatcher in dispatchers.called:
        function = dispatcher.py_func
        for made in dispatcher.overloads.values():
            kinds = [_kind(given) for given in made.signature.args]
            result = RESULTS.get(str(made.signature.return_type))
            if result is None or None in kinds:
                raise BuildError(
                    f"kernel {function.__name__}: those of a library get arrays and numbers and return nothing or an "
                    f"integer, not {made.signature}"
                )
            signature = result(*(kind for kind in kinds if kind is not None))
            arguments = tuple(word for kind in signature.arguments for word in _words(kind))
            built = _built(symbol_of(function, signature), function, made, arguments, result.name)
            found[built.symbol] = built
    return [found[symbol] for symbol in sorted(found)]


WIDE_PROCESSOR = "x86-64-v3"  # LLVM's name for those with AVX2
RESULTS = {"none": NONE, "int64": INT}


def _built(
    symbol: str, function: Any, made: Any, arguments: tuple[str, ...] | None, result: str = INT.name
) -> BuiltKernel:
    module = machine_code(made)._get_module_for_linking().as_bitcode()
    compiled_as = made.fndesc.llvm_func_name
    return BuiltKernel(symbol, function.__name__, compiled_as, module, arguments, result, short_hash(function))


def _kind(given: Any) -> Kind | None:
    """Of numba's type of an argument."""
    if hasattr(given, "layout"):
        return array_kind(given.dtype, given.ndim, given.layout, given.mutable)
    return {"int64": INT, "float64": FLOAT, "bool": BOOL}.get(str(given))


def _words(kind: Kind) -> tuple[str, ...]:
    """The numbers that machine code gets for an argument, see libraries.flattened."""
    if isinstance(kind, ArrayKind):
        return "address", "address", "int64", "int64", "address", *("int64",) * (2 * kind.dimensions)
    return (kind.name,)


def collect(
    targets: Iterable[str], processor: str, everything: bool, names: Iterable[str] = ()
) -> list[BuiltKernel]:
    """What worlds of these files may call, of all that ships without any, for such processors: a name that LLVM knows,
    as generic.

    everything
        also what carom's own library has
    names
        of all that ships only functions of these names

    subprocess.CalledProcessError if that process fails; it has told why.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "kernels"
        environment = {OFF: "own", **os.environ, "NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""}
        environment |= {"NUMBA_DISABLE_JIT": "0", "CAROM_CHECK": "0"}
        if everything:
            environment[OFF] = "0"
        code = f"from {__name__} import write; write({[*names]})"
        subprocess.run([sys.executable, "-c", code, str(path), *targets], env=environment, check=True)
        return pickle.loads(path.read_bytes())


def prepare(targets: Sequence[str], names: Sequence[str]) -> None:
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
            kernels = (each for each in shipped_kernels(dimensions) if not names or each.py_func.__name__ in names)
            functions.update(dict.fromkeys(kernels))
    by_symbol: dict[str, Linkable] = {}
    for function in functions:
        known = by_symbol.setdefault(function.symbol, function)
        if short_hash(known.py_func) != short_hash(function.py_func):
            raise BuildError(
                f"two functions {function.py_func.__name__} of one place are different code: name them differently"
            )
    link_all(functions)


def write(names: Sequence[str]) -> None:
    """What that process does."""
    log.processes, log.background = os.cpu_count() or 1, False
    try:
        prepare(sys.argv[2:], names)
        kernels = [*linked_kernels(), *called_kernels()]
    except (BuildError, Problem) as error:
        print(f"carom: {error}", file=sys.stderr)
        sys.exit(Problem.exit_code)
    Path(sys.argv[1]).write_bytes(pickle.dumps(kernels))
