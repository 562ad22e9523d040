"""What the site is made of: every page has its place, every public name its entry. `make docs` builds and checks it."""

from __future__ import annotations

import ast
import importlib
import re
import types
from pathlib import Path

import pytest
from helpers_folders import ROOT

import carom
from studies.site import check, pages
from studies.site.live import SCENES, add_buttons

DOCS = sorted(ROOT.glob("docs/**/*.md"))
API = sorted((ROOT / "docs" / "api").glob("*.md"))
MODULES = (  # whose lists are public
    "carom", "carom.drawing", "carom.lab", "carom.lab.testing", "carom.maps", "carom.plugins.joints", "carom.scenes",
    "carom.view",
)  # fmt: skip


def flat(entries) -> list[str]:
    if isinstance(entries, str):
        return [entries]
    return [page for entry in (entries.values() if isinstance(entries, dict) else entries) for page in flat(entry)]


def test_every_page_is_in_the_navigation_once():
    """It is that of docs/README.md, and folders beside the pages that it lists."""
    listed = flat(pages.navigation())
    assert {page for page in listed if page.startswith("docs/tables/")}
    assert sorted(listed) == sorted([*pages.START, *(page.relative_to(ROOT).as_posix() for page in DOCS)])


def value_of(name: str) -> object:
    """What stands under a dotted name, a module or something in one."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        module, _, last = name.rpartition(".")
        return getattr(value_of(module), last)


def entries() -> list[str]:
    """The names that API pages have, those of a module's list in its place."""
    found = []
    for page in API:
        text = page.read_text(encoding="utf-8")
        for name in (*re.findall(r"^::: ([\w.]+)$", text, re.MULTILINE), *re.findall(r"`(carom\.[\w.]+)`", text)):
            value = value_of(name)
            listed = getattr(value, "__all__", vars(value)) if isinstance(value, types.ModuleType) else ()
            found += [name, *(f"{name}.{each}" for each in listed)]
    return found


def used_in_docs() -> set[str]:
    """What the pages import from modules of carom: it is public, too."""
    found = set()
    for page in DOCS:
        for block in re.findall(r"^```python.*\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL):
            for node in ast.walk(ast.parse(block)):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("carom."):
                    found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def test_every_public_name_is_on_a_page_of_the_reference_once():
    found = entries()
    assert len(found) == len({*found}), sorted({name for name in found if found.count(name) > 1})
    public = {f"{module}.{name}" for module in MODULES for name in getattr(value_of(module), "__all__", ())}
    public |= used_in_docs()
    own = {f"carom.{module}.{name}": f"carom.{name}" for name, module in carom._MODULES.items()}
    values = {name: value_of(name) for name in public}
    missing = {
        name for name, value in values.items()
        if own.get(name, name) not in found and not isinstance(value, types.ModuleType)
    }  # fmt: skip
    assert len(public) > 180
    assert missing == set()


def test_links_to_code_become_links_to_pages_of_it():
    code: set[Path] = set()
    text = "[a](../examples/rollback.py) [b](../scenes) [c](queries.md#rays) [d](pictures/car.png) [e](https://a.b/c)"
    assert pages.linked(text, Path("docs/page.md"), code) == (
        "[a](../examples/rollback.py.md) [b](../scenes/README.md) [c](queries.md#rays) [d](pictures/car.png) "
        "[e](https://a.b/c)"
    )
    assert code == {Path("examples/rollback.py"), Path("scenes")}


@pytest.mark.slow
def test_each_live_scene_has_a_picture_that_its_page_shows(tmp_path):
    pages.copy_pages(tmp_path)
    add_buttons(tmp_path)  # ValueError for a page without the picture
    for page, (_, scene) in SCENES.items():
        assert f'data-live="{scene}"' in (tmp_path / page).read_text(encoding="utf-8")


@pytest.fixture
def site(tmp_path) -> Path:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "index.html").write_text('<h2 id="here">x</h2><a href="..">up</a>')
    (tmp_path / "picture.png").write_bytes(bytes(1000))
    (tmp_path / "index.html").write_text(
        '<p id="top"><a href="other/#here"></a><a href="#top"></a><a href="https://a.b/c"></a><img src="picture.png">'
    )
    return tmp_path


def test_a_site_without_faults_has_no_findings(site):
    assert check.findings(site) == []


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('<a href="gone/">x</a>', "gone/ does not exist"),
        ('<img src="gone.png">', "gone.png does not exist"),
        ('<a href="other/#gone">x</a>', "other/#gone: no such anchor"),
        ('<a href="#gone">x</a>', "#gone: no such anchor"),
        (f'<img src="picture.png">{" " * 399_000}', "400 KB with its pictures, more than 400"),
    ],
)
def test_each_fault_of_a_site_is_found(site, text, found):
    (site / "index.html").write_text(text)
    assert check.findings(site) == [f"index.html: {found}"]
