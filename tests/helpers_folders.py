"""The folders of the product, from the lowest up, and the packages that they are."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FLOORS = ("framework", "components", "systems", "plugins", "scenes", "lab")  # each imports from those before it


def package_of(folder: Path) -> str:
    return ".".join(("carom", *folder.relative_to(ROOT).parts))
