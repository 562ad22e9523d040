"""The tables for those who know another engine are complete, and the names of carom in them are carom's."""

from __future__ import annotations

import inspect
import re

import pymunk
import pytest
from helpers_folders import ROOT
from pymunk import constraints

import carom
from carom.framework.data.columns import Column

PAGES = sorted((ROOT / "docs" / "coming-from").glob("*.md"))
CLASSES = (
    pymunk.Space, pymunk.Body, pymunk.Shape, pymunk.Circle, pymunk.Poly, pymunk.Segment, pymunk.Arbiter,
    pymunk.ShapeFilter, constraints.Constraint, *constraints.Constraint.__subclasses__(),
)  # fmt: skip
WORDS = {"pymunk", "arcade", "gif", "py", "maps"}  # behind a point, and no name of carom


def rows(page) -> list[list[str]]:
    lines = page.read_text(encoding="utf-8").splitlines()
    return [line.strip("| ").split(" | ") for line in lines if line.startswith("| `")]


def test_every_public_name_of_pymunk_has_its_row():
    (page,) = (page for page in PAGES if page.stem == "pymunk")
    told = set(re.findall(r"\w+", " ".join(row[0] for row in rows(page))))
    public = {
        name for kind in CLASSES for name in (kind.__name__, *vars(kind)) if not name.startswith("_")
    }  # fmt: skip
    assert len(public) > 120
    assert public - told - {"Shape", "Constraint"} == set()


def names_of_carom() -> set[str]:
    """What carom's public names have: attributes, fields and parameters."""
    found = {*carom.__all__}
    for value in (getattr(carom, name) for name in carom.__all__):
        members = [member for base in getattr(value, "__mro__", ()) for member in vars(base).values()]
        found |= {*dir(value), *(member.name for member in members if isinstance(member, Column))}
        for function in filter(inspect.isfunction, (value, *(getattr(each, "__func__", each) for each in members))):
            found |= {*inspect.signature(function).parameters}
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_names_of_carom_in_the_tables_exist(page):
    known = names_of_carom() | WORDS
    code = " ".join(" ".join(re.findall(r"`([^`]*)`", row[1])) for row in rows(page))
    used = set(re.findall(r"\.([A-Za-z_]\w+)|([A-Za-z_]\w+)\(|([a-z_]\w+)=", code))
    assert {name for names in used for name in names if name} - known == set()
