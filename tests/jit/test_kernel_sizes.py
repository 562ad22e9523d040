"""Kernels stay small: few arguments, and no more lines than fit on a screen."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("framework", "components", "systems", "plugins")
DECORATORS = {"kernel", "part", "inlined", "pasted", "allocating_kernel"}
ARGUMENTS, LINES = 8, 85


def name_of(decorator):
    if isinstance(decorator, ast.Call):
        decorator = decorator.func
    return getattr(decorator, "attr", getattr(decorator, "id", None))


def kernels():
    """(place, positional arguments, lines) of all compiled functions: by their decorators, or that they take state."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if not isinstance(node, ast.FunctionDef):
                    continue
                arguments = [argument.arg for argument in (*node.args.posonlyargs, *node.args.args)]
                decorated = any(name_of(decorator) in DECORATORS for decorator in node.decorator_list)
                if decorated or arguments[:1] == ["state"]:
                    place = f"{path.relative_to(ROOT)}:{node.lineno} {node.name}"
                    yield place, len(arguments), node.end_lineno - node.lineno + 1


def test_kernels_take_few_arguments_and_are_short():
    found = list(kernels())
    assert len(found) > 100  # of several hundred
    offenders = [
        f"{place}: {arguments} arguments, {lines} lines"
        for place, arguments, lines in found
        if arguments > ARGUMENTS or lines > LINES
    ]
    assert not offenders, "\n".join(offenders)
