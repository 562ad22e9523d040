"""Sources: no circle of imports, kernels take few arguments and are short, names have one meaning, columns a unit,
faults a row in the docs, and no libm.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from helpers_folders import FLOORS, ROOT, imported, package_of

from carom.framework.jit.records.schema import Schema
from carom.systems.records import STATE


def modules() -> dict[str, Path]:
    """All modules of the product by name; a package stands for its ``__init__``."""
    paths = [path for floor in FLOORS for path in sorted((ROOT / floor).rglob("*.py"))]
    return {f"{package_of(path.parent)}.{path.stem}".removesuffix(".__init__"): path for path in paths}


def imports(name: str, path: Path, known: dict[str, Path]) -> set[str]:
    """The modules that a module imports."""
    found = {target if target in known else target.rpartition(".")[0] for target in imported(path)}
    return (found & known.keys()) - {name}


def circles(graph: dict[str, set[str]]) -> list[str]:
    """What is left when modules that import nothing of the rest, or that nothing of it imports, are taken away."""
    left = dict(graph)
    while True:
        imported = set().union(*left.values()) if left else set()
        ends = [name for name, targets in left.items() if not targets & left.keys() or name not in imported]
        if not ends:
            return sorted(left)
        for name in ends:
            del left[name]


def test_no_modules_import_each_other_in_a_circle():
    known = modules()
    graph = {name: imports(name, path, known) for name, path in known.items()}
    assert len(graph["carom.framework.world.world"]) > 10  # imports are seen
    assert circles(graph) == []


FOLDERS = ("framework", "components", "systems", "plugins")
DECORATORS = {"kernel", "part", "inlined", "pasted"}
ARGUMENTS, LINES = 8, 85


def name_of(decorator):
    if isinstance(decorator, ast.Call):
        decorator = decorator.func
    return getattr(decorator, "attr", getattr(decorator, "id", None))


@cache
def all_nodes() -> list[tuple[str, ast.AST]]:
    """(place, node) of all nodes of the engine's sources that a test asks for."""
    return [
        (f"{path.relative_to(ROOT)}:{node.lineno}", node)
        for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, (ast.FunctionDef, ast.Call, ast.Attribute, ast.BinOp))
    ]  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _forget():
    yield
    all_nodes.cache_clear()


def nodes(kind: type[ast.AST]) -> Iterator[tuple[str, ast.AST]]:
    """Those of that kind."""
    return (each for each in all_nodes() if isinstance(each[1], kind))


def kernels():
    """(place, positional arguments, lines) of all compiled functions: by their decorators, or that they take state."""
    for place, node in nodes(ast.FunctionDef):
        arguments = [argument.arg for argument in (*node.args.posonlyargs, *node.args.args)]
        if arguments[:1] == ["state"] or any(name_of(decorator) in DECORATORS for decorator in node.decorator_list):
            yield f"{place} {node.name}", len(arguments), node.end_lineno - node.lineno + 1


def test_kernels_take_few_arguments_and_are_short():
    found = list(kernels())
    assert len(found) > 100  # of several hundred
    offenders = [
        f"{place}: {arguments} arguments, {lines} lines"
        for place, arguments, lines in found
        if arguments > ARGUMENTS or lines > LINES
    ]
    assert not offenders, "\n".join(offenders)


def defined_in_systems() -> Iterator[tuple[str, str]]:
    """(name, module) of all functions and constants of the modules of systems."""
    for path in sorted((ROOT / "systems").rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef):
                yield node.name, str(path)
            elif isinstance(node, (ast.Assign, ast.AnnAssign)):
                names = [name for name in ast.walk(node) if isinstance(name, ast.Name) and name.id.isupper()]
                yield from ((name.id, str(path)) for name in names if isinstance(name.ctx, ast.Store))


@pytest.mark.slow
def test_a_constant_or_function_of_systems_has_one_meaning():
    places = defaultdict(list)
    for name, path in defined_in_systems():
        places[name].append(path)
    assert len(places) > 1000
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


SEVERAL_UNITS = {
    "Joints.numbers", "Direct.root", "Direct.diagonal", "Direct.solution", "Direct.values", "Tree.extremes",
}  # fmt: skip


def test_columns_and_numbers_of_the_records_carry_their_unit():
    schemas, bare = [STATE], set()
    for schema in schemas:  # grows
        for name, field in schema.fields.items():
            if isinstance(field, Schema):
                schemas.append(field)
            elif field.dtype == "float64" and not field.unit:
                bare.add(f"{schema.name}.{name}")
    assert bare == SEVERAL_UNITS


def text_of(node):
    """A text with dots where it has values; None if it is made elsewhere."""
    if isinstance(node, ast.Constant):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "..." for part in node.values)
    return None


def test_every_fault_stands_in_the_table_of_the_docs():
    found = {place: text_of(call.args[0]) for place, call in nodes(ast.Call) if name_of(call) == "report_fault"}
    assert None not in found.values(), f"write the text where it is reported: {found}"
    page = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")
    table = page.split("<!-- faults -->")[1].split("<!-- end of faults -->")[0]
    rows = [line for line in table.splitlines() if line.startswith("| `")]
    assert all(len(row.strip("| ").split(" | ")) == 3 for row in rows)
    assert set(found.values()) == {row.split("`")[1] for row in rows}


LIBM = {
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh",
    "tanh", "asinh", "acosh", "atanh", "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "pow", "power",
    "float_power", "cbrt", "hypot", "gamma", "lgamma", "erf", "erfc", "frexp", "ldexp", "fmod", "sinc",
}  # fmt: skip
REPORTS = {  # what they find goes to the user alone, or is exact
    "framework/data/interpolation.py": {"arctan2", "sinc"},  # what is drawn
    "framework/elementary.py": {"frexp", "ldexp"},
    "framework/schedule/clock.py": {"fmod"},
    "plugins/convex_polygon.py": {"hypot", "arctan2"},  # what is wrong with corners
    "plugins/joints/measures.py": {"sin", "cos", "arctan2"},
    "plugins/terrain/chain.py": {"hypot"},  # whether all is upside down
}  # fmt: skip


def test_no_libm_in_what_a_step_does():
    found: dict[str, set[str]] = {}
    for place, node in nodes(ast.Attribute):
        if isinstance(node.value, ast.Name) and node.value.id in ("math", "np") and node.attr in LIBM:
            found.setdefault(place.partition(":")[0].replace("\\", "/"), set()).add(node.attr)
    assert found == REPORTS


def test_no_power_but_of_whole_numbers():
    """Python and numba leave others to libm; ``elementary.power`` does not."""
    found = [place for place, node in nodes(ast.BinOp) if isinstance(node.op, ast.Pow) and is_broken(node.right)]
    assert found == []


def is_broken(exponent: ast.expr) -> bool:
    """Whether it is written with a fraction."""
    for node in ast.walk(exponent):
        if isinstance(node, ast.Div) or (isinstance(node, ast.Constant) and isinstance(node.value, float)):
            return True
    return False
