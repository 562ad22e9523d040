"""The platforms that libraries of kernels are built for: what LLVM, the linker and wheels call them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from ...framework.jit.libraries import platform_name


@dataclass(frozen=True)
class Platform:
    """One kind of machine that a library is built for.

    name
        how carom's command names it
    triple, processor, features
        LLVM's: the processor is one whose code runs on every machine of the platform
    pointer_bytes
        size of an address
    wheel_tag
        the platform in the name of a wheel
    suffix
        of the file that Python imports: the stable ABI's, so that one file holds for every Python from 3.11 on
    python
        the tags of Python and ABI in the name of a wheel
    """

    name: str
    triple: str
    wheel_tag: str
    pointer_bytes: int = 8
    processor: str = "generic"
    features: str = ""
    suffix: str = ".abi3.so"
    python: str = "cp311-abi3"

    @property
    def is_windows(self) -> bool:
        return "windows" in self.triple

    @property
    def is_macos(self) -> bool:
        return "apple" in self.triple

    @property
    def is_wasm(self) -> bool:
        return self.triple.startswith("wasm")

    @property
    def is_x86(self) -> bool:
        return self.triple.startswith("x86_64")

    @property
    def is_arm(self) -> bool:
        return self.triple.startswith(("aarch64", "arm64"))

    @property
    def with_avx2(self) -> Platform:
        """The same for processors that have AVX2, and of what others lack no more: they are asked for it alone."""
        return replace(self, features="+avx2")

    @cached_property
    def target_machine(self) -> Any:
        """LLVM's, for code that can stand at any address. Products and sums stay apart: nobody allows LLVM to fuse."""
        from llvmlite import binding

        binding.initialize_all_targets()
        binding.initialize_all_asmprinters()
        return binding.Target.from_triple(self.triple).create_target_machine(
            cpu=self.processor, features=self.features, opt=3, reloc="pic",
            codemodel="default" if self.is_wasm else "small",
        )  # fmt: skip


# No file needs more of Linux than the C library that Python itself has loaded, so the oldest tag is true.
PLATFORMS = {
    platform.name: platform
    for platform in (
        Platform("linux-x86_64", "x86_64-unknown-linux-gnu", "manylinux_2_17_x86_64.musllinux_1_1_x86_64"),
        Platform("linux-aarch64", "aarch64-unknown-linux-gnu", "manylinux_2_17_aarch64.musllinux_1_1_aarch64"),
        Platform("macos-arm64", "arm64-apple-macosx11.0.0", "macosx_11_0_arm64"),
        Platform("win-amd64", "x86_64-pc-windows-msvc", "win_amd64", suffix=".pyd"),
        Platform(  # one file for the ABIs of Pyodide 0.27, 0.29 and 314
            "wasm32", "wasm32-unknown-emscripten",
            "pyodide_2024_0_wasm32.pyemscripten_2025_0_wasm32.pyemscripten_2026_0_wasm32", pointer_bytes=4,
        ),
    )
}  # fmt: skip


def native() -> Platform | None:
    """The platform of this Python; None: none of those that carom builds for."""
    return PLATFORMS.get(platform_name())
