"""The pages of the site: the Markdown of the repository with its folders, so that links hold as they are."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
START = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")  # beside docs/
LINK = re.compile(r"\]\(([^()#:\s]+)(#[^()\s]*)?\)")
UNSEARCHED = "---\nsearch: { exclude: true }\n---\n\n"  # of pages that are code
MARKED = re.compile(r"^( *```python) .*$", re.MULTILINE)  # what only the tests of docs/ read


def copy_pages(into: Path) -> None:
    """Copy the start page and docs/, and make a page of every file and folder of code that one of them links."""
    shutil.copytree(ROOT / "docs", into / "docs")
    for name in START:
        shutil.copyfile(ROOT / name, into / name)
    code: set[Path] = set()
    for page in sorted(into.rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        page.write_text(MARKED.sub(r"\1", linked(text, page.relative_to(into), code)), encoding="utf-8")
    for path in sorted(code):
        write_code(path, into)
    shutil.copyfile(Path(__file__).with_name("site.css"), into / "site.css")


def linked(text: str, page: Path, code: set[Path]) -> str:
    """The text with links to pages of code in place of those to code; these are added to ``code``."""

    def goal(match: re.Match[str]) -> str:
        path = Path(os.path.normpath(page.parent / match[1]))
        if path.suffix in (".md", ".png", ".webp") or not (ROOT / path).exists():
            return match[0]
        code.add(path)
        return f"]({match[1].rstrip('/')}{'/README' if (ROOT / path).is_dir() else ''}.md)"

    return LINK.sub(goal, text)


def write_code(path: Path, into: Path) -> None:
    """The page of a file, or of a folder with those of all its modules."""
    if not (ROOT / path).is_dir():
        text = (ROOT / path).read_text(encoding="utf-8")
        page = into / f"{path}.md"
        page.parent.mkdir(parents=True, exist_ok=True)
        kind = "python" if path.suffix == ".py" else "text"
        page.write_text(f"{UNSEARCHED}# {path.name}\n\n````{kind}\n{text.rstrip()}\n````\n", encoding="utf-8")
        return
    files = [file.relative_to(ROOT) for file in sorted((ROOT / path).rglob("*.py")) if file.stat().st_size]
    lines = [f"# {path.as_posix()}/", "", "| file | |", "|---|---|"]
    for file in files:
        write_code(file, into)
        about = (ast.get_docstring(ast.parse((ROOT / file).read_text(encoding="utf-8"))) or "").partition("\n\n")[0]
        about = re.sub(r":\w+:`([^`]*)`", r"`\1`", " ".join(about.split())).replace("|", "\\|")
        name = file.relative_to(path).as_posix()
        lines.append(f"| [`{name}`]({name}.md) | {about} |")
    (into / path / "README.md").write_text("\n".join((*lines, "")), encoding="utf-8")


def navigation() -> list[dict[str, Any]]:
    """The groups of docs/README.md with their pages; a page with a folder of its name is a group with those of it."""
    text = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    groups: list[dict[str, Any]] = []
    for group in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        title, _, rest = group.partition("\n")
        rows = "".join(re.findall(r"^\| \[.*$", rest, re.MULTILINE))
        pages = dict.fromkeys(f"docs/{name}" for name, _ in LINK.findall(rows) if name.endswith(".md"))
        if pages:
            groups.append({title: [with_folder(page) for page in pages]})
    return [{"carom": ["README.md", "docs/README.md"]}, *groups, {"Project": list(START[1:])}]


def with_folder(page: str) -> str | dict[str, list[str]]:
    folder = ROOT / page.removesuffix(".md")
    if not folder.is_dir():
        return page
    title = (ROOT / page).read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
    return {title: [page, *(each.relative_to(ROOT).as_posix() for each in sorted(folder.glob("*.md")))]}


def write_settings(into: Path, scripts: Sequence[str]) -> None:
    """mkdocs.yml of the repository with the navigation and these scripts; JSON is YAML."""
    inherited = os.path.relpath(ROOT / "mkdocs.yml", into)
    settings = {"INHERIT": inherited, "extra_javascript": scripts, "nav": navigation()}
    (into / "mkdocs.yml").write_text(json.dumps(settings, indent=1), encoding="utf-8")
