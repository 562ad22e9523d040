"""How kernels are compiled: numba's own passes, without what kernels have no use for.

numba compiles every function as if Python called it: it translates closures and comprehensions, annotates types for
reports, optimises each function alone and again inside of each caller, and makes machine code of all of them. Kernels
are written without closures, their helpers are only ever compiled into them, and many are alike in what they ask of
type inference. Leaving that out takes a third of the time and changes no bit of a result.

numba's internals are touched here and nowhere else. They are known to be as expected from version 0.62 to 0.68; with
any other, kernels compile as numba does by itself, and take longer.
"""

from __future__ import annotations

import types as python_types
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

import numba
from llvmlite.binding import Linkage
from numba import _dynfunc  # pyright: ignore[reportAttributeAccessIssue]
from numba.core import typed_passes, types, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import LoweringPass, PassManager, register_pass
from numba.core.environment import lookup_environment
from numba.core.transforms import canonicalize_cfg
from numba.core.typing.templates import Signature

from .hash import is_packed

TRIED = (0, 62), (0, 68)  # the versions whose internals are as expected here

_REPORTS = {typed_passes.AnnotateTypes, typed_passes.DumpParforDiagnostics}
_CLOSURES = {untyped_passes.InlineClosureLikes, untyped_passes.MakeFunctionToJitFunction}
_ARRAYS = {typed_passes.InlineOverloads, typed_passes.NopythonRewrites}
_LOWERING = typed_passes.NativeLowering


class _Passes(PassManager):
    """Runs passes without the records and the repeated clean-up around each."""

    def _runPass(self, index: int, pss: Any, internal_state: Any) -> None:  # noqa: N802  # numba's name
        pss.analysis = self._analysis
        pss.run_initialization(internal_state)
        changed = pss.run_pass(internal_state)
        pss.run_finalizer(internal_state)
        if changed and not isinstance(pss, LoweringPass):
            internal_state.func_ir.blocks = canonicalize_cfg(internal_state.func_ir.blocks)


class _TypingContext:
    """numba's typing context, which remembers what operators and intrinsics answered for which types."""

    _known: ClassVar[WeakKeyDictionary[Any, dict[Any, Signature]]] = WeakKeyDictionary()

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        if kws or not isinstance(func, (types.Function, python_types.BuiltinFunctionType)):
            return self._context.resolve_function_type(func, args, kws)
        answers = self._known.setdefault(func, {})
        if args not in answers:
            found = self._context.resolve_function_type(func, args, kws)
            if found is None:
                return None
            answers[args] = found
        return answers[args]


class _PartLibrary(JITCodeLibrary):
    """Code that is only ever linked into that of kernels: optimised there, and no machine code of its own."""

    def finalize(self) -> None:
        self._finalized = True


class _KernelLibrary(JITCodeLibrary):
    """Takes in the parts that a kernel calls, directly or through others."""

    counts_references = False
    packs = False  # see compilation.packed

    def finalize(self) -> None:
        # The linker skips what nothing has asked for so far: callers come before what they call.
        self._linking_libraries = list(reversed(_with_needed(self._linking_libraries, {})))
        super().finalize()

    def _optimize_final_module(self) -> None:
        # Parts are the kernel's own: two kernels from the cache may each hold another part of one name.
        for function in self._final_module.functions:
            if function.linkage == Linkage.linkonce_odr:
                function.linkage = Linkage.internal
        if self.counts_references:
            super()._optimize_final_module()
        else:  # numba optimises twice, to drop counts in between
            passes, builder = self._codegen._module_pass_manager(**({"slp_vectorize": True} if self.packs else {}))
            passes.run(self._final_module, builder)


def _with_needed(libraries: list[Any], found: dict[Any, None]) -> dict[Any, None]:
    """These and what they need, each after all that it needs."""
    for library in libraries:
        if library not in found:
            if isinstance(library, _PartLibrary):
                _with_needed(library._linking_libraries, found)
            found[library] = None
    return found


@register_pass(mutates_CFG=True, analysis_only=False)
class _KernelLowering(_LOWERING):
    """Lowering, and machine code; with it go the environments of all parts that have become part of the kernel."""

    _name = "carom_kernel_lowering"

    def run_pass(self, state: Any) -> bool:
        codegen = state.targetctx.codegen()
        library = state["library"] = _KernelLibrary(codegen, state.func_id.func_qualname)
        library.counts_references, library.packs = state.flags.nrt, is_packed(state.func_id.func)
        library.enable_object_caching()
        super().run_pass(state)
        for variable in library._final_module.global_variables:
            environment = lookup_environment(variable.name)  # what the code raises errors from
            if environment is not None:
                codegen.set_env(variable.name, environment)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(_LOWERING):
    """Lowering alone."""

    _name = "carom_part_lowering"

    def run_pass(self, state: Any) -> bool:
        state["library"] = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered, libraries = state["cr"], (state["library"],)
        # numba knows what can be called by such an object; this one is no entry into machine code.
        known_by = _dynfunc.make_function(
            lowered.fndesc.lookup_module(), state.func_id.func_name, "a part of kernels", 0, lowered.env, libraries
        )
        state.targetctx.insert_user_function(known_by, lowered.fndesc, libraries)
        state["cr"] = lowered._replace(cfunc=known_by)
        return True


class _KernelCompiler(Compiler):
    lowering: type[LoweringPass] = _KernelLowering

    def __init__(self, typingctx: Any, *arguments: Any) -> None:
        super().__init__(typingctx, *arguments)
        self.state.typingctx = _TypingContext(typingctx)

    def define_pipelines(self) -> list[Any]:
        (whole,) = super().define_pipelines()
        passes = _Passes(whole.pipeline_name)
        left_out = _REPORTS | (set() if _has_closures(self.state.func_id.func) else _CLOSURES)
        if not self.state.flags.nrt:
            left_out |= _ARRAYS
        for step, description in whole.passes:
            if step not in left_out:
                passes.add_pass(self.lowering if step is _LOWERING else step, description)
        passes.finalize()
        return [passes]


class _PartCompiler(_KernelCompiler):
    lowering = _PartLowering


def _has_closures(function: python_types.FunctionType) -> bool:
    return any(isinstance(constant, python_types.CodeType) for constant in function.__code__.co_consts)


_known_version = TRIED[0] <= numba.version_info.short <= TRIED[1]

# For functions that Python or an address calls; and for those that are only ever compiled into them.
kernel_compiler: type[Compiler] = _KernelCompiler if _known_version else Compiler
part_compiler: type[Compiler] = _PartCompiler if _known_version else Compiler
