"""What kernels call that is in no process without numba, in LLVM's language.

:func:`replacements` come into the module of each kernel, inlined: instructions in place of calls, and the clock.
:func:`beside` is one object of the library: numba's runtime for arrays and for errors with values, and what processors
lack.
"""

from __future__ import annotations

from collections.abc import Iterable

from .platforms import Platform

ROUNDING = ("rint", "floor", "ceil", "trunc")
# numba's runtime, as far as it is written here.
RUNTIME = frozenset(
    {"NRT_Allocate", "NRT_Free", "NRT_MemInfo_alloc", "NRT_MemInfo_alloc_aligned", "NRT_MemInfo_call_dtor"}
)


def replacements(platform: Platform, environments: Iterable[str] = ()) -> str:
    """What takes the place of functions that numba's modules call; what a module does not call does not come in.

    environments
        numba's variables that point to what a function raises errors from: code asks only whether there is something
    """
    if platform.is_wasm:
        ticks = _TICKS_OF_PAGE
    else:  # the cycle counter traps on ARM, where the steady counter is free for all
        ticks = _TICKS_OF_PROCESSOR.format(counter="readsteadycounter" if platform.is_arm else "readcyclecounter")
    one = (_INSTRUCTION.format(name=name, taken="double %x", kinds="double") for name in ("sqrt", "fabs", *ROUNDING))
    two = _INSTRUCTION.format(name="copysign", taken="double %x, double %y", kinds="double, double")
    there = (f'@"{name}" = hidden global ptr @"{name}"\n' for name in environments)
    return "".join([*one, two, ticks, _COUNT_DOWN, _NARROWED if platform.is_wasm else "", *there])


def beside(platform: Platform) -> str:
    """The object that every library of the platform has beside its kernels; the linker drops what is not called."""
    wide = platform.pointer_bytes == 8
    text = _RUNTIME.format(
        size="i64" if wide else "i32", narrow="add i64 %bytes, 0" if wide else "trunc i64 %bytes to i32"
    )
    if platform.triple.startswith("x86_64"):
        text += _ROUNDING
    if platform.is_wasm:
        text += _WASM
    if platform.is_windows:
        text += _WINDOWS
    return text


# A call of the C library becomes an instruction, where the processor has one.
_INSTRUCTION = """
declare double @llvm.{name}.f64({kinds})
define linkonce double @{name}({taken}) alwaysinline {{
  %result = call double @llvm.{name}.f64({taken})
  ret double %result
}}
"""

# Whether nothing is left, as LLVM asks the flags of x86 for it.
_COUNT_DOWN = """
define linkonce i8 @carom_count_down(ptr %count, i64 %less, i32 %condition) alwaysinline {
  %before = atomicrmw sub ptr %count, i64 %less seq_cst
  %none_left = icmp eq i64 %before, %less
  %result = zext i1 %none_left to i8
  ret i8 %result
}
"""

_TICKS_OF_PROCESSOR = """
declare i64 @llvm.{counter}()
define linkonce i64 @carom_ticks() alwaysinline {{
  %ticks = call i64 @llvm.{counter}()
  ret i64 %ticks
}}
"""

_TICKS_OF_PAGE = """
declare double @emscripten_get_now()
define linkonce i64 @carom_ticks() alwaysinline {
  %milliseconds = call double @emscripten_get_now()
  %nanoseconds = fmul double %milliseconds, 1.0e6
  %ticks = fptosi double %nanoseconds to i64
  ret i64 %ticks
}
"""

_NARROWED = """
declare ptr @PyTuple_New(i32)
declare i32 @PyTuple_SetItem(ptr, i32, ptr)
define linkonce ptr @carom_tuple_new(i64 %long) alwaysinline {
  %count = trunc i64 %long to i32
  %tuple = call ptr @PyTuple_New(i32 %count)
  ret ptr %tuple
}
define linkonce i32 @carom_tuple_set(ptr %tuple, i64 %long, ptr %item) alwaysinline {
  %place = trunc i64 %long to i32
  %failed = call i32 @PyTuple_SetItem(ptr %tuple, i32 %place, ptr %item)
  ret i32 %failed
}
"""

# As numba lays it out for addresses of 64 bits, which its modules count with on every platform: count of references,
# function to call at the end and its argument, data, size, allocator.
_RUNTIME = """
declare ptr @malloc({size})
declare void @free(ptr)
define hidden ptr @NRT_Allocate(i64 %bytes) #0 {{
  %size = {narrow}
  %memory = call ptr @malloc({size} %size)
  ret ptr %memory
}}
define hidden void @NRT_Free(ptr %memory) #0 {{
  call void @free(ptr %memory)
  ret void
}}
define hidden ptr @NRT_MemInfo_alloc(i64 %bytes) #0 {{
  %info = call ptr @NRT_MemInfo_alloc_aligned(i64 %bytes, i32 16)
  ret ptr %info
}}
define hidden ptr @NRT_MemInfo_alloc_aligned(i64 %bytes, i32 %align) #0 {{
  %step = zext i32 %align to i64
  %with_head = add i64 %bytes, 48
  %whole = add i64 %with_head, %step
  %info = call ptr @NRT_Allocate(i64 %whole)
  %none = icmp eq ptr %info, null
  br i1 %none, label %failed, label %fill
failed:
  ret ptr null
fill:
  %start = ptrtoint ptr %info to i64
  %behind_head = add i64 %start, 47
  %beyond = add i64 %behind_head, %step
  %places = sub i64 0, %step
  %aligned = and i64 %beyond, %places
  %data = inttoptr i64 %aligned to ptr
  call void @llvm.memset.p0.i64(ptr %info, i8 0, i64 48, i1 false)
  store i64 1, ptr %info
  %data_at = getelementptr i8, ptr %info, i64 24
  store ptr %data, ptr %data_at
  %size_at = getelementptr i8, ptr %info, i64 32
  store i64 %bytes, ptr %size_at
  ret ptr %info
}}
define hidden void @NRT_MemInfo_call_dtor(ptr %info) #0 {{
  %end_at = getelementptr i8, ptr %info, i64 8
  %end = load ptr, ptr %end_at
  %none = icmp eq ptr %end, null
  br i1 %none, label %release, label %call
call:
  %data_at = getelementptr i8, ptr %info, i64 24
  %data = load ptr, ptr %data_at
  %size_at = getelementptr i8, ptr %info, i64 32
  %size = load i64, ptr %size_at
  %argument_at = getelementptr i8, ptr %info, i64 16
  %argument = load ptr, ptr %argument_at
  call void %end(ptr %data, i64 %size, ptr %argument)
  br label %release
release:
  call void @free(ptr %info)
  ret void
}}
declare void @llvm.memset.p0.i64(ptr, i8, i64, i1)
attributes #0 = {{ nounwind "no-builtins" }}
"""

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

# The product of two numbers of 128 bits, which LLVM calls; and Python's function for the values of errors, which numba
# calls with a count of 64 bits.
_WASM = """
declare void @llvm.va_start.p0(ptr)
declare void @llvm.va_end.p0(ptr)
declare ptr @PyTuple_New(i32)
declare i32 @PyTuple_SetItem(ptr, i32, ptr)
define hidden ptr @PyTuple_Pack(i64 %long_count, ...) #0 {
  %arguments = alloca ptr
  call void @llvm.va_start.p0(ptr %arguments)
  %count = trunc i64 %long_count to i32
  %tuple = call ptr @PyTuple_New(i32 %count)
  %none = icmp eq ptr %tuple, null
  br i1 %none, label %done, label %next
next:
  %k = phi i32 [ 0, %0 ], [ %following, %set ]
  %end = icmp eq i32 %k, %count
  br i1 %end, label %done, label %set
set:
  %item = va_arg ptr %arguments, ptr
  call i32 @PyTuple_SetItem(ptr %tuple, i32 %k, ptr %item)
  %following = add i32 %k, 1
  br label %next
done:
  call void @llvm.va_end.p0(ptr %arguments)
  ret ptr %tuple
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
