"""The folders of the product, from the lowest up, and the packages that they are."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Each imports from those before it.
FLOORS = ("framework", "components", "systems", "plugins", "drawing", "maps", "view", "scenes", "lab")


def package_of(folder: Path) -> str:
    return ".".join(("carom", *folder.relative_to(ROOT).parts))


def imported(path: Path) -> Iterator[str]:
    """What a module imports, wherever the statement stands: ``a.b`` for ``from a import b``."""
    package = package_of(path.parent).split(".")
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else []
            yield from (".".join((*base, *filter(None, (node.module,)), alias.name)) for alias in node.names)


def game_of_the_page() -> str:
    """The game of docs/ship-your-game.md."""
    text = (ROOT / "docs" / "ship-your-game.md").read_text(encoding="utf-8")
    return re.findall(r"```python no-run\n(.*?)```", text, re.DOTALL)[0]
