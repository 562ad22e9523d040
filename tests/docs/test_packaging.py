"""The package as shipped: listed packages, contents of a wheel, and imports between packages."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import tarfile
import zipfile
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest
from helpers_folders import FLOORS, ROOT, imported, package_of
from helpers_packages import build, copied_sources

import carom
from carom.framework import Component, Plugin

OUTSIDE = ("studies", "tests", "examples")  # not installed: nothing that is may import them


def python_files(folder: str) -> list[Path]:
    """The modules that are installed."""
    files = sorted((ROOT / folder).rglob("*.py"))
    return [path for path in files if "__pycache__" not in path.parts]


def test_the_root_package_holds_names_and_links():
    root = ROOT / "src" / "carom"
    files = {"__init__.py", "__init__.pyi", "__main__.py", "py.typed"}
    built = {"__pycache__", *(path.name for path in root.glob("_kernels.*"))}
    assert {path.name for path in root.iterdir()} - built == files | set(FLOORS)
    for floor in FLOORS:
        assert (root / floor).resolve() == ROOT / floor


def test_every_folder_with_modules_is_a_package():
    for folder in {path.parent for floor in FLOORS for path in python_files(floor)}:
        assert (folder / "__init__.py").is_file(), f"{folder} lacks __init__.py"


def test_each_name_of_carom_is_one_of_its_module_and_of_the_stub():
    """The stub is made of the list; a module's components and plugins, and what makes bodies, are in it."""
    lines = []
    for module, names in sorted(carom._NAMES.items()):
        found = importlib.import_module(f"carom.{module}")
        assert {*names} == {*found.__all__}, module
        in_order = sorted(names, key=lambda name: (name[0].islower(), name.lower()))
        each = [f"from .{module} import {name} as {name}" for name in in_order]
        lines += each if "." in module else [f"from .{module} import *"]
        for value in vars(found).values():
            if isinstance(value, type) and value.__module__.startswith(found.__name__) and value.__name__ not in names:
                assert not issubclass(value, Plugin), value
                assert not issubclass(value, Component) or value._abstract, value
        for name in names:
            assert getattr(carom, name) is getattr(found, name)
    stub = "\n".join((*lines, "", "__version__: str", ""))
    assert (ROOT / "src" / "carom" / "__init__.pyi").read_text(encoding="utf-8") == stub
    with pytest.raises(AttributeError, match="module 'carom' has no attribute 'Wrold'"):
        carom.Wrold  # noqa: B018


def run_elsewhere(code: str, folder: Path, place: Path) -> str:
    """What Python prints in a folder, with carom from a place."""
    environment = {**os.environ, "PYTHONPATH": str(place)}
    command = [sys.executable, "-c", code]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True).stdout


def test_importing_carom_loads_none_of_its_parts():
    code = "import sys, carom; print([name for name in sys.modules if name.startswith(('carom.', 'numpy', 'numba'))])"
    assert run_elsewhere(code, ROOT, ROOT / "src").strip() == "[]"


def imported_floors(path: Path) -> set[str]:
    """The floors that a module imports from, for any form of import."""
    found = set()
    for target in imported(path):
        first, second, *_ = (*target.split("."), "")
        assert first not in FLOORS, f"{path} imports {target}: only carom.* is a package"
        assert first not in OUTSIDE, f"{path} imports {target}, which is not installed"
        found |= {second} & {*FLOORS} if first == "carom" else set()
    return found


@pytest.mark.parametrize("floor", FLOORS)
def test_each_floor_imports_only_from_the_floors_below(floor):
    allowed = set(FLOORS[: FLOORS.index(floor) + 1])
    for path in python_files(floor):
        if path.name == "__main__.py":  # the only one that imports upwards, from the command line
            continue
        above = imported_floors(path) - allowed
        assert not above, f"{path.relative_to(ROOT)} imports from {sorted(above)}"


@pytest.mark.slow
def test_importing_physics_imports_no_drawing_and_no_command_line():
    modules = run_elsewhere("import sys, carom.plugins; print('\\n'.join(sys.modules))", ROOT, ROOT / "src").split()
    unwanted = ("click", "rich", "matplotlib", "carom.lab", "carom.scenes")
    assert "carom.plugins" in modules
    assert not [m for m in modules if m in unwanted or m.startswith(tuple(f"{name}." for name in unwanted))]


@pytest.mark.slow
def test_importing_the_window_and_the_maps_loads_no_package_of_an_extra():
    """Extras are loaded when they are used, so the rooms can be imported, and read about, without them."""
    rooms = "carom.drawing", "carom.maps", "carom.view", "carom.lab"
    extras = ("pygame", "moderngl", "pyglet", "pytiled_parser", "matplotlib", "PIL", "imageio_ffmpeg", "mapbox_earcut")
    code = f"import sys, {', '.join(rooms)}; print([name for name in {extras} if name in sys.modules])"
    assert run_elsewhere(code, ROOT, ROOT / "src").strip() == "[]"


@pytest.fixture(scope="module")
def source_copy(tmp_path_factory) -> Path:
    """The sources, so that building leaves nothing behind in the checkout, with what must be in no package: the
    checkout's own library, and a module that was deleted after the last build."""
    copy = tmp_path_factory.mktemp("source") / "carom"  # the name a clone is likely to have
    former = copied_sources(copy) / "build" / "lib" / "carom"
    former.mkdir(parents=True)
    for folder, name in ((former, "deleted.py"), (copy / "src" / "carom", f"_kernels{EXTENSION_SUFFIXES[-1]}")):
        (folder / name).write_bytes(b"")
    return copy


@pytest.mark.slow
def test_a_wheel_holds_exactly_the_packages(source_copy, tmp_path):
    wheel = build("wheel", source_copy, tmp_path)
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        metadata = next(n for n in archive.namelist() if n.endswith(".dist-info/entry_points.txt"))
        entry_points = archive.read(metadata).decode()
    expected = {"carom/py.typed", *(f"carom/__{name}" for name in ("init__.py", "init__.pyi", "main__.py"))}
    for floor in FLOORS:
        for path in python_files(floor):
            expected.add("/".join((*package_of(path.parent).split("."), path.name)))
    web = "lab/build/web"
    expected |= {f"carom/{web}/{path.name}" for path in (ROOT / web).iterdir() if path.suffix in (".html", ".mjs")}
    assert names == expected
    assert "carom = carom.__main__:main" in entry_points


@pytest.mark.slow
@pytest.mark.parametrize("installed", ["editable", "wheel"])
def test_a_clone_named_carom_in_the_working_folder_hides_nothing(source_copy, tmp_path, installed):
    """An editable install puts src on the path; a folder without __init__.py comes after any package of its name."""
    place = ROOT / "src"
    if installed == "wheel":
        place = tmp_path
        with zipfile.ZipFile(build("wheel", source_copy, tmp_path)) as archive:
            archive.extractall(place)
    code = "import carom; from carom import Physics, World; print(carom.__file__, World(Physics()))"
    assert run_elsewhere(code, source_copy.parent, place).startswith(str(place / "carom" / "__init__.py"))


@pytest.mark.slow
def test_a_source_distribution_holds_the_tests(source_copy, tmp_path):
    archive = build("sdist", source_copy, tmp_path)
    with tarfile.open(archive) as tar:
        names = {name.partition("/")[2] for name in tar.getnames()}
    assert {
        "tests/docs/test_packaging.py",
        "studies/runner.py",
        "LICENSE",
        "README.md",
        "src/carom/py.typed",
        "src/carom/lab/cli/main.py",
    } <= names
    assert not [name for name in names if "/_kernels." in name or "deleted" in name]


@pytest.mark.slow
@pytest.mark.parametrize("code", ["import carom.framework, carom.plugins, carom.scenes", "import carom.lab.cli.main"])
def test_the_compiler_is_not_loaded_by_an_import(code):
    """numba and llvmlite take longer than all the rest; a program that asks for help or lists scenes needs neither."""
    check = f"{code}, sys; print([name for name in ('numba', 'llvmlite') if name in sys.modules])"
    assert run_elsewhere(check, ROOT, ROOT / "src").strip() == "[]"
