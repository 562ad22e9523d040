"""Scenes that run in the pages of the site: ``python -m studies.site --live PYODIDE``.

One folder, live/, has the page that ``carom build --web`` makes, with the kernels of all scenes below. A page shows its
picture with a button under it, which puts live/?SCENE in place of the picture: nothing is loaded before.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

# Page: its picture, and the scene: a file of examples/, or a module of carom.scenes.
SCENES = {
    "README.md": ("docs/pictures/pegs.webp", "pegs"),
    "docs/plugins/joints.md": ("../pictures/ragdoll.png", "ragdoll"),
    "docs/plugins/rotation.md": ("../pictures/dominoes.png", "dominoes"),
}
OWN = Path(__file__).parent
ROOT = OWN.parents[2]


def add_buttons(pages: Path) -> None:
    """A button below the picture of each scene."""
    for page, (picture, scene) in SCENES.items():
        text = (pages / page).read_text(encoding="utf-8")
        before, found, after = text.partition(f"]({picture})\n")
        if not found:
            raise ValueError(f"{page} does not show {picture}")
        button = f'\n<p><button class="md-button" data-live="{scene}">Run it here</button></p>\n'
        (pages / page).write_text(f"{before}{found}{button}{after}", encoding="utf-8")
    shutil.copyfile(OWN / "live.js", pages / "live.js")


def build_live(scratch: Path, folder: Path, pyodide: str) -> None:
    """Make the page of all scenes with ``carom build --web``; ``pyodide``: a URL, or a folder, which is copied."""
    scratch.mkdir()
    shutil.copyfile(OWN / "show.py", scratch / "show.py")
    for _, scene in SCENES.values():
        example, file = ROOT / "examples" / f"{scene}.py", scratch / f"{scene}.py"
        text = f"from carom.scenes import {scene} as own\n\nVIEW, SECONDS, build = own.VIEW, own.SECONDS, own.build\n"
        file.write_text(example.read_text(encoding="utf-8") if example.is_file() else text, encoding="utf-8")
    games = ["show.py", *(f"{scene}.py" for _, scene in SCENES.values())]
    at = "pyodide" if Path(pyodide).is_dir() else pyodide
    command = [sys.executable, "-m", "carom", "build", "--web", str(folder), "--pyodide", at, *games]
    subprocess.run(command, cwd=scratch, check=True)
    if Path(pyodide).is_dir():
        shutil.copytree(pyodide, folder / "pyodide")
