"""From object files to a library that Python loads, for any platform.

A library has no other library that it is linked with: Python's functions, and the few of the C library that machine
code may call, are in every process that imports it, and are found when it is loaded. Windows alone wants to be told
which library has them. zig's linker (extra ``build``) writes all formats on every machine; without it a library for the
machine itself is linked by what stands there.
"""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .errors import BuildError
from .objects import IN_PROCESS, MATHEMATICS, MEMORY, PYTHON, PYTHON_DATA, support
from .platforms import Platform, native

# Where Windows has what a library calls. The first forwards to the library of whatever Python is running.
_WINDOWS = {
    "python3.dll": [*sorted(PYTHON), *(f"{name} DATA" for name in sorted(PYTHON_DATA))],
    "ucrtbase.dll": sorted(MEMORY | MATHEMATICS),
    "ntdll.dll": ["__chkstk"],  # called by functions with more than a page on the stack
}


def link(objects: Sequence[bytes], output: Path, platform: Platform) -> None:
    """Write the extension module of these object files, which has one ``PyInit_`` function.

    output
        its path; the name without suffixes is the module's

    Raises BuildError if there is no linker for the platform, if it fails, or if what the objects call is nowhere.
    """
    module = output.name.partition(".")[0]
    linker = linker_for(platform)
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for number, content in enumerate([*objects, support(platform)]):
            file = Path(folder, f"{number}.o")
            file.write_bytes(content)
            files.append(file.name)
        options = _options(platform, module, linker, Path(folder))
        Path(folder, "all").write_text("\n".join([*options, *files]), encoding="utf-8")  # more than a command may have
        said = _run([*linker, "@all", *(["--warn-unresolved-symbols"] if platform.is_wasm else [])], folder)
        missing = sorted(set(_UNDEFINED.findall(said)) - IN_PROCESS)
        if missing:
            raise BuildError(f"{output.name} calls {', '.join(missing)}, which no process of Python has")
        if platform.is_wasm:  # what it warns of it does not import
            _run([*linker, "@all", "--unresolved-symbols=import-dynamic"], folder)
        output.parent.mkdir(parents=True, exist_ok=True)
        unfinished = output.with_name(f"{output.name}.unfinished")
        shutil.copyfile(Path(folder, "linked"), unfinished)
        os.replace(unfinished, output)  # a process may have loaded the file that stood there


# As LLVM's linker and GNU's say it.
_UNDEFINED = re.compile(r"undefined (?:symbol: |reference to [`'])([\w.$]+)")


def linker_for(platform: Platform) -> list[str]:
    """The command of a linker for the platform's format; BuildError if there is none here."""
    if platform.is_windows:
        name, own = "lld-link", []
    elif platform.is_macos:
        name, own = "cc", ["cc"]
    elif platform.is_wasm:
        name, own = "wasm-ld", []
    else:
        name, own = "ld.lld", ["ld"]
    if importlib.util.find_spec("ziglang") is not None:
        target = ["-target", "aarch64-macos.11.0"] if platform.is_macos else []
        return [sys.executable, "-m", "ziglang", name, *target]
    found = [path for tool in ([] if platform.is_macos else [name]) if (path := shutil.which(tool))]
    if platform == native():
        found += [path for tool in own if (path := shutil.which(tool))]
    if not found:
        raise BuildError(
            f"there is no linker here for {platform.name}: install zig's with pip install carom[build]"
            + (f", or {' or '.join(own)}" if own and platform == native() else "")
        )
    return found[:1]


def _options(platform: Platform, module: str, linker: list[str], folder: Path) -> list[str]:
    if platform.is_windows:
        libraries = []
        for dll, names in _WINDOWS.items():
            library = f"{dll.removesuffix('.dll')}.lib"
            (folder / "names.def").write_text(
                f"LIBRARY {dll}\nEXPORTS\n" + "\n".join(f"  {name}" for name in names) + "\n", encoding="utf-8"
            )
            _run([*linker, "/lib", "/machine:x64", "/def:names.def", f"/out:{library}"], str(folder))
            libraries.append(library)
        return [
            "/dll", "/noentry", "/nodefaultlib", "/machine:x64", "/opt:ref", "/Brepro", "/out:linked", *libraries,
        ]  # fmt: skip
    if platform.is_macos:
        return [
            "-shared", "-nostdlib", "-o", "linked", "-Wl,-undefined,dynamic_lookup", "-Wl,-dead_strip", "-Wl,-x",
            f"-Wl,-install_name,@rpath/{module}{platform.suffix}",
        ]  # fmt: skip
    if platform.is_wasm:
        return [
            "-shared", "--experimental-pic", "--no-entry", "--gc-sections", "--strip-all",
            "--warn-unresolved-symbols", f"--export=PyInit_{module}", "-o", "linked",
        ]  # fmt: skip
    return [
        "-shared", "-o", "linked", "--gc-sections", "--strip-all", "--build-id=none", "-z", "now", "-z", "defs",
        "-z", "noexecstack", "--warn-unresolved-symbols",
    ]  # fmt: skip


def _run(command: list[str], folder: str) -> str:
    """What the command says; BuildError with its last words if it fails."""
    caches = {"ZIG_GLOBAL_CACHE_DIR": folder, "ZIG_LOCAL_CACHE_DIR": folder}  # nothing is left in a home folder
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, errors="replace", stdin=subprocess.DEVNULL,
        env={**os.environ, **caches},
    )  # fmt: skip
    said = done.stdout + done.stderr
    if done.returncode:
        errors = [line for line in said.splitlines() if "error:" in line] or said.strip().splitlines()[-1:]
        raise BuildError(f"the linker ended with status {done.returncode}: {'; '.join(errors[:5])}")
    return said
