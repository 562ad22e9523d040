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

from .errors import BuildError
from .platforms import Platform

# What the C library has, which Python itself needs everywhere, so that it is in each process.
MEMORY = frozenset({"memcpy", "memmove", "memset"})
ROUNDING = frozenset({"rint", "floor", "ceil", "trunc"})
_mathematics = """
acos acosh asin asinh atan atan2 atanh cos cosh erf erfc exp exp2 expm1 fmod hypot lgamma log log10 log1p log2 pow sin
sinh tan tanh tgamma
"""
# Of the stable ABI: what this folder's glue and numba's code that packs the values of an error may ask for.
_python = """
PyDict_New PyDict_SetItemString PyErr_Clear PyErr_Format PyErr_Occurred PyErr_SetString PyFloat_AsDouble
PyFloat_FromDouble PyLong_AsLongLong PyLong_FromLongLong PyLong_FromUnsignedLongLong PyLong_FromVoidPtr
PyModule_AddObject PyModule_Create2 PyObject_CallFunction PyObject_IsTrue PyTuple_New PyTuple_SetItem
PyUnicode_FromString Py_BuildValue Py_DecRef Py_IncRef
"""
MATHEMATICS, PYTHON = frozenset(_mathematics.split()), frozenset(_python.split())
PYTHON_DATA = frozenset({"PyExc_RuntimeError", "PyExc_TypeError"})

IN_PROCESS = MEMORY | MATHEMATICS | PYTHON | PYTHON_DATA | {"sincos"}  # the last: LLVM's, of a sine and a cosine

_TICKS = "llvm.readcyclecounter"
# The instruction that numba's modules ask for traps on ARM, where the steady counter is free for all; wasm has none.
_TICKS_OF_ARM, _TICKS_OF_WASM = "llvm.readsteadycounter", "carom_ticks"


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
    for function in module.functions:
        if function.is_declaration:
            if function.name == _TICKS and platform.is_arm:
                function.name = _TICKS_OF_ARM
            elif function.name == _TICKS and platform.is_wasm:
                function.name = _TICKS_OF_WASM
        elif function.name in exported:
            function.name = exported[function.name]
            function.linkage, function.visibility = Linkage.external, "hidden"
        else:
            function.linkage = Linkage.internal
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage = Linkage.internal
    passes = binding.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, binding.create_pass_builder(machine, binding.create_pipeline_tuning_options(speed_level=3)))
    _refuse_missing(module)
    return machine.emit_object(module)


def assemble(text: str, platform: Platform) -> bytes:
    """An object file out of LLVM's language; its triple and data layout are set here."""
    machine = platform.target_machine
    module = binding.parse_assembly(text)
    module.triple, module.data_layout = platform.triple, str(machine.target_data)
    module.verify()
    return machine.emit_object(module)


def support(platform: Platform) -> bytes:
    """The object file that every library of the platform has beside its kernels."""
    text = 'attributes #0 = { nounwind "no-builtins" }\n'
    if platform.triple.startswith("x86_64"):
        text += _ROUNDING
    if platform.is_wasm:
        text += _WASM
    if platform.is_windows:
        text += _WINDOWS
    return assemble(text, platform)


def _refuse_missing(module: Any) -> None:
    known = IN_PROCESS | ROUNDING | {_TICKS_OF_WASM}
    values = [*module.functions, *module.global_variables]
    declared = {value.name for value in values if value.is_declaration and not value.name.startswith("llvm.")}
    kernels = sorted(f.name for f in module.functions if not f.is_declaration and f.linkage == Linkage.external)
    missing = sorted(declared - known)
    if missing:
        raise BuildError(
            f"{', '.join(kernels)}: the machine code needs {', '.join(missing)}, which only a process with numba has: "
            "leave out what makes arrays, strings or objects"
        )


# Older x86-64 processors have no instructions for these. Adding and taking away 2**52 rounds to a whole number; each
# result is exact and has the sign of the argument.
_ROUNDING = """
declare double @llvm.fabs.f64(double)
declare double @llvm.copysign.f64(double, double)
define hidden double @rint(double %x) #0 {
  %size = call double @llvm.fabs.f64(double %x)
  %inside = fcmp olt double %size, 4503599627370496.0
  %large = fadd double %size, 4503599627370496.0
  %whole = fsub double %large, 4503599627370496.0
  %signed = call double @llvm.copysign.f64(double %whole, double %x)
  %result = select i1 %inside, double %signed, double %x
  ret double %result
}
define hidden double @floor(double %x) #0 {
  %near = call double @rint(double %x)
  %above = fcmp ogt double %near, %x
  %below = fsub double %near, 1.0
  %result = select i1 %above, double %below, double %near
  ret double %result
}
define hidden double @ceil(double %x) #0 {
  %near = call double @rint(double %x)
  %below = fcmp olt double %near, %x
  %above = fadd double %near, 1.0
  %result = select i1 %below, double %above, double %near
  %signed = call double @llvm.copysign.f64(double %result, double %x)
  ret double %signed
}
define hidden double @trunc(double %x) #0 {
  %size = call double @llvm.fabs.f64(double %x)
  %whole = call double @floor(double %size)
  %result = call double @llvm.copysign.f64(double %whole, double %x)
  ret double %result
}
"""

# The clock of the page in nanoseconds, and the product of two numbers of 128 bits, which LLVM calls.
_WASM = """
declare double @emscripten_get_now()
define hidden i64 @carom_ticks() #0 {
  %milliseconds = call double @emscripten_get_now()
  %nanoseconds = fmul double %milliseconds, 1.0e6
  %ticks = fptosi double %nanoseconds to i64
  ret i64 %ticks
}
define hidden i128 @__multi3(i128 %a, i128 %b) #0 {
  %a_low = trunc i128 %a to i64
  %b_low = trunc i128 %b to i64
  %a_shifted = lshr i128 %a, 64
  %b_shifted = lshr i128 %b, 64
  %a_high = trunc i128 %a_shifted to i64
  %b_high = trunc i128 %b_shifted to i64
  %a0 = and i64 %a_low, 4294967295
  %b0 = and i64 %b_low, 4294967295
  %a1 = lshr i64 %a_low, 32
  %b1 = lshr i64 %b_low, 32
  %low = mul i64 %a_low, %b_low
  %p00 = mul i64 %a0, %b0
  %p10 = mul i64 %a1, %b0
  %p01 = mul i64 %a0, %b1
  %p11 = mul i64 %a1, %b1
  %carry00 = lshr i64 %p00, 32
  %middle = add i64 %p10, %carry00
  %middle_low = and i64 %middle, 4294967295
  %middle_high = lshr i64 %middle, 32
  %other = add i64 %p01, %middle_low
  %carry = lshr i64 %other, 32
  %high0 = add i64 %p11, %middle_high
  %high1 = add i64 %high0, %carry
  %cross0 = mul i64 %a_high, %b_low
  %cross1 = mul i64 %a_low, %b_high
  %high2 = add i64 %high1, %cross0
  %high = add i64 %high2, %cross1
  %wide_low = zext i64 %low to i128
  %wide_high = zext i64 %high to i128
  %up = shl i128 %wide_high, 64
  %result = or i128 %up, %wide_low
  ret i128 %result
}
"""

# A symbol that says that there are floating-point numbers.
_WINDOWS = "@_fltused = hidden global i32 1"
