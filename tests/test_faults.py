"""The table of faults in docs/worlds.md against the texts in the code."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("framework", "components", "systems", "plugins")


def text_of(node):
    """A text with dots where it has values; None if it is made elsewhere."""
    if isinstance(node, ast.Constant):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "..." for part in node.values)
    return None


def faults_in_code():
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "report_fault":
                    yield f"{path.relative_to(ROOT)}:{node.lineno}", text_of(node.args[0])


def faults_in_docs():
    page = (ROOT / "docs" / "worlds.md").read_text(encoding="utf-8")
    table = page.split("<!-- faults -->")[1].split("<!-- end of faults -->")[0]
    rows = [line for line in table.splitlines() if line.startswith("| `")]
    assert all(len(row.strip("| ").split(" | ")) == 3 for row in rows)
    return {row.split("`")[1] for row in rows}


def test_every_fault_stands_in_the_table():
    found = dict(faults_in_code())
    assert None not in found.values(), f"write the text where it is reported: {found}"
    assert set(found.values()) == faults_in_docs()
