"""The manual is correct: every Python block of README.md and docs/ runs, and every link between pages is valid.

The blocks of one page run in order and share one namespace, as if pasted by a reader. They are compiled with the
page's name and lines, so a traceback shows the line of the page.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import traceback
import types
import zipfile
from dataclasses import dataclass
from pathlib import Path

import esper
import pytest
from click.testing import CliRunner

from carom.framework import World

pytestmark = pytest.mark.early

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^(?P<indent> *)(?P<marks>`{3,}|~{3,})(?P<info>[^`]*)$")
MARKS = ("no-run", "game")  # not run; a part of a game whose lines are counted
LINK = re.compile(r"\]\(\s*(?P<target>[^()\s]*(?:\([^()\s]*\)[^()\s]*)*)[^()]*\)")  # nested links: both


@dataclass
class Block:
    """A fenced block: the text after the fence, the number of its first line, its content."""

    info: list[str]
    line: int
    text: str


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix() if page.is_relative_to(ROOT) else page.name


def split(text: str, name: str) -> tuple[list[Block], list[str]]:
    """The fenced blocks of a page, and its lines with those of blocks left empty."""
    blocks: list[Block] = []
    prose: list[str] = []
    fence: re.Match[str] | None = None
    start, inside = 0, []
    for number, line in enumerate(text.splitlines(), 1):
        match = FENCE.match(line)
        if fence is None and match:
            fence, start, inside = match, number + 1, []
        elif fence is not None and match and not match["info"].strip() and match["marks"].startswith(fence["marks"]):
            indent = len(fence["indent"])
            blocks.append(Block(fence["info"].split(), start, "".join(inner[indent:] + "\n" for inner in inside)))
            fence = None
        elif fence is not None:
            inside.append(line)
        prose.append("" if fence is not None or match else line)
    assert fence is None, f"{name}:{start - 1}: this block is never closed"
    return blocks, prose


def python_blocks(page: Path) -> list[Block]:
    """The blocks to run. A misspelt mark is an error, because it would silently exclude a block."""
    blocks, _ = split(page.read_text(encoding="utf-8"), name_of(page))
    for block in blocks:
        info = block.info[:1] + [mark for mark in block.info[1:] if mark not in MARKS]
        assert not info or "py" not in info[0] or info == ["python"], (
            f"{name_of(page)}:{block.line - 1}: write ```python, alone or with {' or '.join(MARKS)}, "
            f"not ```{' '.join(block.info)}"
        )
    return [block for block in blocks if block.info[:1] == ["python"] and "no-run" not in block.info]


def run(blocks: list[Block], page: Path, namespace: dict[str, object]) -> None:
    """Execute blocks of a page one after the other; AssertionError names page and line of what fails."""
    for block in blocks:
        try:
            exec(compile("\n" * (block.line - 1) + block.text, str(page), "exec"), namespace)
        except Exception as error:
            line = line_of(error, page) or block.line
            shown = page.read_text(encoding="utf-8").splitlines()[line - 1].strip()
            raise AssertionError(
                f"{name_of(page)}:{line}: {type(error).__name__}: {error}\n    {shown}\n\n"
                + "".join(traceback.format_exception(error))
            ) from None


def line_of(error: Exception, page: Path) -> int | None:
    """The innermost line of the page on the error's traceback."""
    if isinstance(error, SyntaxError) and error.filename == str(page):
        return error.lineno
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(page)]
    return lines[-1] if lines else None


@pytest.fixture
def namespace(monkeypatch, tmp_path):
    """A module for the page to run in, in an empty folder; its worlds are closed afterwards."""
    module = types.ModuleType("page_of_the_manual")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.chdir(tmp_path)
    worlds = set(esper.list_worlds())
    yield vars(module)
    for value in list(vars(module).values()):
        if isinstance(value, World):
            value.close()
    esper.switch_world("default")
    for left in set(esper.list_worlds()) - worlds:  # left by functions: no name of the page holds them
        esper.delete_world(left)


# Each compiles for a quarter of a minute or more where the cache is empty, or is a study of many runs.
SLOW = (
    "write-a-shape.md", "tile_grid.md", "capsule.md", "convex_hull.md", "convex_polygon.md",
    "trade.md", "integrators.md", "collisions.md", "character.md", "platformer.md", "maps.md",
)  # fmt: skip
RUN = [
    pytest.param(page, marks=pytest.mark.slow if page.name in SLOW else ())
    for page in PAGES if python_blocks(page)
]  # fmt: skip


@pytest.mark.parametrize("page", RUN, ids=name_of)
def test_the_python_blocks_run(page, namespace, monkeypatch):
    run(python_blocks(page), page, namespace)


def lines_of_code(text: str) -> int:
    """Lines that are neither blank nor only a comment."""
    return sum(1 for line in text.splitlines() if line.strip() and not line.strip().startswith("#"))


@pytest.mark.parametrize(("page", "lines"), [("asteroids.md", 60), ("platformer.md", 40)])
def test_it_is_a_game_in_so_many_lines(page, lines):
    game = [block for block in python_blocks(ROOT / "docs" / page) if "game" in block.info]
    assert lines / 2 < sum(lines_of_code(block.text) for block in game) <= lines


def test_every_recipe_says_what_comes_out():
    """Each section of the cookbook is code of its own that ends with what has to hold."""
    recipes = []
    for page in (ROOT / "docs" / "recipes.md", *(ROOT / "docs" / "recipes").glob("*.md")):
        sections = re.split(r"^## ", page.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
        recipes += [(name_of(page), text.partition("\n")[0], split(text, name_of(page))[0]) for text in sections]
    assert len(recipes) >= 30
    silent = [f"{page}: {name}" for page, name, blocks in recipes if not any("assert " in b.text for b in blocks)]
    assert silent == []
    longest = max(lines_of_code(block.text) for _, _, blocks in recipes for block in blocks)
    assert longest <= 30


def test_the_game_of_the_readme_prints_what_the_page_says(namespace, capsys):
    page = ROOT / "README.md"
    run(python_blocks(page), page, namespace)
    blocks, _ = split(page.read_text(encoding="utf-8"), name_of(page))
    assert capsys.readouterr().out == "".join(block.text for block in blocks if block.info == ["text"])


@pytest.mark.slow
def test_the_scene_file_runs_for_as_long_as_it_says(monkeypatch, tmp_path):
    from carom.lab.cli.main import cli

    monkeypatch.chdir(tmp_path)
    block, *_ = python_blocks(ROOT / "docs" / "scene-files.md")
    Path("funnel.py").write_text(block.text, encoding="utf-8")
    result = CliRunner().invoke(cli, ["run", "funnel.py", "--json", "--no-pictures", "--set", "dt=1/120"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["steps"] == 4 * 120


@pytest.mark.slow
def test_the_commands_of_the_collision_page_draw_its_pictures(monkeypatch, tmp_path):
    from carom.lab.cli.main import cli

    page = ROOT / "docs" / "collisions.md"
    blocks, _ = split(page.read_text(encoding="utf-8"), name_of(page))
    commands = [line.split() for block in blocks if block.info == ["sh"] for line in block.text.splitlines()]
    monkeypatch.chdir(tmp_path)
    for command in commands:
        assert command[0] == "carom"
        result = CliRunner().invoke(cli, command[1:])
        assert result.exit_code == 0, result.output
    drawn = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.png")}
    shown = {f"docs/{target}" for _, target in links(page) if target.endswith(".png")}
    assert drawn == shown
    assert len(commands) == len(drawn)
    assert all((ROOT / picture).stat().st_size < 60_000 for picture in shown)


def test_the_scene_file_page_has_every_option():
    from carom.lab.cli.run import run_command

    text = (ROOT / "docs" / "scene-files.md").read_text(encoding="utf-8")
    parameters = run_command.params
    options = {option for parameter in parameters for option in parameter.opts if option.startswith("--")}
    assert set(re.findall(r"^\| `(--[a-z-]+)", text, re.MULTILINE)) == options - {"--help"}


@pytest.mark.long  # lab/test_cli_plugins.py offers plugins to carom, too, and the page's blocks run above
def test_the_package_of_the_shape_page_can_be_built_found_and_tested(tmp_path):
    """The files as on the page, built into a wheel and put on Python's path; then the page's commands."""
    blocks, _ = split((ROOT / "docs" / "write-a-shape.md").read_text(encoding="utf-8"), "write-a-shape.md")
    source, site = tmp_path / "source", tmp_path / "site"
    source.mkdir()
    python = [block for block in blocks if block.info[:1] == ["python"]]
    (project,) = [block for block in blocks if block.info == ["toml"]]
    (test,) = [block for block in python if "no-run" in block.info]
    for name, block in {"diamond.py": python[0], "pyproject.toml": project, "test_diamond.py": test}.items():
        (source / name).write_text(block.text, encoding="utf-8")
    places = os.pathsep.join(filter(None, (str(site), os.environ.get("PYTHONPATH"))))

    def run_python(*arguments: str, folder: Path = tmp_path) -> str:
        done = subprocess.run(
            [sys.executable, *arguments], cwd=folder, capture_output=True, text=True,
            env={**os.environ, "PYTHONPATH": places, "COLUMNS": "200"},
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    build = "import setuptools.build_meta as b; print(b.build_wheel('..'))"
    wheel = run_python("-c", build, folder=source).strip().splitlines()[-1]
    with zipfile.ZipFile(tmp_path / wheel) as archive:
        archive.extractall(site)
    (source / "diamond.py").unlink()  # the test must use the installed file
    assert "3 passed" in run_python("-m", "pytest", "-q", "-p", "no:cacheprovider", folder=source)
    listed = run_python("-m", "carom", "plugins")
    assert re.search(r"diamond +1\.0 +carom-diamond +shapes DiamondCollider; pairs DiamondCollider and Sphere", listed)
    run_python("-m", "carom", "run", "gas2d", "--plugin", "diamond", "--steps", "2", "--no-pictures")


# -- links ---------------------------------------------------------------------------------------


def links(page: Path) -> list[tuple[int, str]]:
    """(line, target) of the page's links and pictures, outside of code."""
    _, prose = split(page.read_text(encoding="utf-8"), name_of(page))
    found = []
    for number, line in enumerate(prose, 1):
        found += [(number, match["target"]) for match in LINK.finditer(re.sub(r"`[^`]*`", "``", line))]
    return found


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, generated as code hosts do."""
    _, prose = split(page.read_text(encoding="utf-8"), name_of(page))
    found: set[str] = set()
    for line in prose:
        heading = re.match(r"^#{1,6}\s+(.*?)\s*#*$", line)
        if not heading:
            continue
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading[1]).lower()
        anchor = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        number = 0
        while (anchor if not number else f"{anchor}-{number}") in found:
            number += 1
        found.add(anchor if not number else f"{anchor}-{number}")
    return found


def dead_links(page: Path, root: Path = ROOT) -> list[str]:
    """The page's relative links that are dead, with their lines."""
    dead = []
    for line, target in links(page):
        if re.match(r"[a-z][a-z0-9+.-]*:", target):
            continue
        path, _, anchor = target.partition("#")
        goal = (page.parent / path).resolve() if path else page
        if not goal.exists():
            dead.append(f"{name_of(page)}:{line}: {target} does not exist")
        elif not goal.is_relative_to(root):
            dead.append(f"{name_of(page)}:{line}: {target} leads out of the project")
        elif anchor and goal.suffix == ".md" and anchor not in anchors(goal):
            dead.append(f"{name_of(page)}:{line}: {target}: {name_of(goal)} has no such heading")
    return dead


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_the_links_lead_somewhere(page):
    assert dead_links(page) == []


# -- the tests' own machinery --------------------------------------------------------------------


def test_a_failing_block_is_reported_with_its_page_and_line(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Page\n\n```python\nx = 1\n```\n\nText.\n\n```python\ny = x + 1\nassert y == 3, 'wrong'\n```\n")
    blocks, _ = split(page.read_text(), "page.md")
    with pytest.raises(AssertionError, match=r"^page\.md:11: AssertionError: wrong\n    assert y == 3"):
        run(blocks, page, {})
    page.write_text("```python\nx = (\n```\n")
    blocks, _ = split(page.read_text(), "page.md")
    with pytest.raises(AssertionError, match=r"^page\.md:2: SyntaxError"):
        run(blocks, page, {})


def test_a_dead_link_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# One `two`, three\n\n[a](page.md) [b](#one-two-three) [c](gone.md)\n[d](#gone) `[e](x.md)`\n")
    assert dead_links(page, tmp_path) == [
        "page.md:3: gone.md does not exist",
        "page.md:4: #gone: page.md has no such heading",
    ]
