"""From numba's modules to object files of any platform.

numba's modules are taken as it has optimised them: what remains is to rename, to drop what no kernel of the library
reaches, to replace what a platform lacks, and to write machine code. Beside the kernels stands one object of helpers
(:func:`support`): what processors without an instruction for it take from other libraries elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from llvmlite import binding
from llvmlite.binding import Linkage

from . import helpers
from .errors import BuildError
from .platforms import Platform

# What the C library has, which Python itself needs everywhere, so that it is in each process.
MEMORY = frozenset({"free", "malloc", "memcpy", "memmove", "memset"})
_mathematics = """
acos acosh asin asinh atan atan2 atanh cos cosh erf erfc exp exp2 expm1 fmod hypot lgamma log log10 log1p log2 pow sin
sinh tan tanh tgamma
"""
# Of the stable ABI: what this folder's glue and numba's code that packs the values of an error may ask for.
_python = """
PyDict_New PyDict_SetItemString PyErr_Clear PyErr_Format PyErr_Occurred PyErr_SetString PyFloat_AsDouble
PyFloat_FromDouble PyLong_AsLongLong PyLong_FromLongLong PyLong_FromUnsignedLongLong PyLong_FromVoidPtr
PyModule_AddObject PyModule_Create2 PyObject_CallFunction PyObject_IsTrue PyTuple_New PyTuple_Pack
PyTuple_SetItem PyUnicode_FromString Py_BuildValue Py_DecRef Py_IncRef
"""
MATHEMATICS, PYTHON = frozenset(_mathematics.split()), frozenset(_python.split())
PYTHON_DATA = frozenset({"PyExc_RuntimeError", "PyExc_TypeError"})

# The last: a page's clock, and what LLVM makes of a sine and a cosine of one angle.
IN_PROCESS = MEMORY | MATHEMATICS | PYTHON | PYTHON_DATA | {"emscripten_get_now", "sincos"}

# What numba's modules hold for the processor they were made on, and what stands for it, see helpers: a counter of time,
# and counting references down.
_REPLACED = {
    "llvm.readcyclecounter": "carom_ticks", "llvm.readsteadycounter": "carom_ticks",
    "llvm.x86.atomic.sub.cc.i64": "carom_count_down",
}  # fmt: skip
# Functions of Python with a size that numba takes to have 64 bits.
_NARROWED = {"PyTuple_New": "carom_tuple_new", "PyTuple_SetItem": "carom_tuple_set"}


def retarget(bitcode: bytes, platform: Platform, exported: Mapping[str, str]) -> bytes:
    """An object file of the functions named in ``exported``, out of one of numba's modules.

    bitcode
        of a module that numba has optimised, for any processor
    exported
        names in the library by numba's symbols; those that the module does not define are passed over

    Raises BuildError if the module needs what no library has.
    """
    module = binding.parse_bitcode(bitcode)
    machine = platform.target_machine
    module.triple, module.data_layout = platform.triple, str(machine.target_data)
    replaced = {**_REPLACED, **(_NARROWED if platform.is_wasm else {})}
    for function in module.functions:
        if function.is_declaration:
            function.name = replaced.get(function.name, function.name)
        elif function.name in exported:
            function.name = exported[function.name]
            function.linkage, function.visibility = Linkage.external, "hidden"
        else:
            function.linkage = Linkage.internal
    environments = [variable.name for variable in module.global_variables if "NumbaEnv" in variable.name]
    module.link_in(_parsed(helpers.replacements(platform, environments), platform))
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage, variable.visibility = Linkage.internal, "default"
        elif platform.is_windows:
            variable.storage_class = "dllimport"
    passes = binding.create_new_module_pass_manager()
    passes.add_always_inliner_pass()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, binding.create_pass_builder(machine, binding.create_pipeline_tuning_options(speed_level=3)))
    _refuse_missing(module, platform)
    return machine.emit_object(module)


def assemble(text: str, platform: Platform) -> bytes:
    """An object file out of LLVM's language; its triple and data layout are set here."""
    return platform.target_machine.emit_object(_parsed(text, platform))


def _parsed(text: str, platform: Platform) -> Any:
    module = binding.parse_assembly(text)
    module.triple, module.data_layout = platform.triple, str(platform.target_machine.target_data)
    module.verify()
    return module


def support(platform: Platform) -> bytes:
    """The object file that every library of the platform has beside its kernels."""
    return assemble(helpers.beside(platform), platform)


def _refuse_missing(module: Any, platform: Platform) -> None:
    values = [*module.functions, *module.global_variables]
    declared = {value.name for value in values if value.is_declaration}
    own = "llvm.x86." if platform.triple.startswith("x86") else "llvm.aarch64." if platform.is_arm else "llvm.wasm."
    foreign = tuple({"llvm.x86.", "llvm.aarch64.", "llvm.wasm."} - {own})  # LLVM would end the process
    outside = {name for name in declared if name.startswith(foreign) or not name.startswith("llvm.")}
    missing = sorted(outside - IN_PROCESS - helpers.RUNTIME)
    if missing:
        kernels = sorted(f.name for f in module.functions if not f.is_declaration and f.linkage == Linkage.external)
        raise BuildError(
            f"{', '.join(kernels)}: the machine code needs {', '.join(missing)}, which only a process with numba has: "
            "leave out what makes arrays, strings or objects"
        )
