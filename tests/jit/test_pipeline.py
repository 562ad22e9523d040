"""How kernels are compiled: the shortened way gives the code that numba's own gives."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest
from llvmlite.binding import Linkage
from numba.core.compiler import Compiler

from carom.framework.compilation import inlined, kernel, part
from carom.framework.jit import pipeline
from carom.framework.jit.cache import machine_code
from carom.framework.jit.dispatchers import KeptDispatcher

jit = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing compiles")
tried = pytest.mark.skipif(pipeline.kernel_compiler is Compiler, reason="numba compiles in its own way")


@part
def halved(x):
    return 0.5 * x


@part
def rooted(x):
    if x < 0.0:
        raise ValueError("no root of a negative number")
    return math.sqrt(halved(x))


@part
def recursive(x):
    return x if x < 1.0 else recursive(x - 1.0) * recursive(x - 2.0) + 1.0


@part
def of_no_type(x):
    return x.of_no_type


@part
def sum_of(first, second, more):
    total = first + (of_no_type(first) if len(more) > 0 else 0.0)
    if len(more) > 0 and second > 0.0:
        total += of_no_type(second)
    return total + second


@kernel
def sum_kernel(x):
    return sum_of(x, halved(x), ())


@part
def chained(x):
    return x if x < 1.0 else chained(x - 1.0) + 1.0


@inlined
def forced(x):
    return chained(x)


@kernel
def forced_kernel(x):
    return forced(x)


@kernel
def long_kernel(x):
    return recursive(x)


@kernel
def rooted_kernel(x):
    return rooted(x) + halved(x)


@kernel
def nested(n):
    total = 0
    for k in range(n):
        total += sum([j * k for j in range(3)])
    return total


def compiled(function, way=pipeline.kernel_compiler):
    """The kernel compiled anew, in that way."""
    made = KeptDispatcher(function.py_func, targetoptions=function.targetoptions, pipeline_class=way)
    made._cache.disable()
    return made


@jit
def test_same_bits_as_numbas_own_way():
    plain = compiled(rooted_kernel, Compiler)
    values = np.random.default_rng(1).uniform(0, 10, 100).tolist()
    assert [rooted_kernel(x) for x in values] == [plain(x) for x in values]
    assert [rooted_kernel(x) for x in values] == [rooted_kernel.py_func(x) for x in values]


@jit
def test_parts_raise_through_kernels():
    """The environments of parts, from which errors are made, are set though parts have no machine code."""
    with pytest.raises(ValueError, match="no root of a negative number"):
        rooted_kernel(-1.0)


@jit
@tried
def test_parts_are_private_to_their_kernel():
    """Else the code of two cached kernels could hold two parts of one name, and the first would serve both."""
    made = compiled(long_kernel)
    made(2.0)
    (result,) = made.overloads.values()
    names = {function.name: function.linkage for function in machine_code(result)._final_module.functions}
    shared = [name for name, linkage in names.items() if linkage == Linkage.linkonce_odr]
    assert not shared
    assert any("recursive" in name and linkage == Linkage.internal for name, linkage in names.items())


@jit
def test_functions_with_closures_compile_whole():
    nested.targetoptions = {**nested.targetoptions, "_nrt": True}  # it makes lists
    assert compiled(nested)(4) == nested.py_func(4)


@jit
@tried
def test_branches_that_an_empty_tuple_rules_out_are_not_compiled():
    assert compiled(sum_kernel)(3.0) == 4.5


@jit
@tried
def test_parts_are_forced_into_their_callers_only_if_they_ask_for_it():
    """Else a part is, wherever it is called, what the first of its callers to be compiled was."""
    made = compiled(forced_kernel)
    made(2.0)
    (result,) = made.overloads.values()
    attributes = [
        [str(attribute) for attribute in function.attributes]
        for function in machine_code(result)._final_module.functions
        if "chained" in function.name
    ]
    assert attributes
    assert not any("alwaysinline" in text for texts in attributes for text in texts)
