"""The page of a trade: valid, self-contained, small, and complete."""

from __future__ import annotations

import base64
import re
import sys
from html.parser import HTMLParser

import helpers_trade as made
import pytest

from carom.lab.commands.usage_errors import Problem
from carom.lab.trading.page import write_page

VOID = {"meta", "img", "br", "hr", "link", "input"}
PICTURE = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


class Reader(HTMLParser):
    """Records the contents of a page, and rejects tags that do not match."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.text: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.seen.append(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)

    def of(self, name: str, tag: str = "") -> list[str]:
        return [value for where, found, value in self.attributes if found == name and (not tag or where == tag)]


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    path = tmp_path_factory.mktemp("pictures") / "the start.png"
    path.write_bytes(PICTURE)
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory, picture):
    pictures = {"orbit": [picture], "my_scene.py": [picture], "nowhere": [picture]}
    trade = made.trade()
    trade.command = "carom trade orbit --note '<b>&'"
    return write_page(trade, tmp_path_factory.mktemp("page") / "new" / "trade.html", pictures)


@pytest.fixture(scope="module")
def reader(path):
    reader = Reader()
    reader.feed(path.read_text(encoding="utf-8"))
    reader.close()
    return reader


@pytest.fixture(scope="module")
def text(reader):
    return " ".join(" ".join(reader.text).split())


def test_tags_are_balanced_and_ids_unique(reader):
    assert reader.open == []
    ids = reader.of("id")
    assert len(ids) > 20
    assert len(ids) == len(set(ids))


def test_nothing_is_fetched_from_elsewhere(reader, path):
    for name in ("src", "href", "xlink:href", "srcset", "action", "data"):
        assert all(value.startswith(("#", "data:")) for value in reader.of(name))
    assert not {"script", "link", "iframe", "object", "base"} & set(reader.seen)
    assert not re.search(r"@import|url\((?!#)|https?:", path.read_text(encoding="utf-8"))


def test_links_lead_somewhere(reader):
    targets = {value[1:] for name in ("href", "xlink:href") for value in reader.of(name) if value.startswith("#")}
    assert targets <= set(reader.of("id"))
    assert {"case-1", "case-2", "case-3"} <= targets


def test_it_is_light_and_says_how_it_is_read(path, reader):
    assert path.stat().st_size < 2_000_000
    assert "width=device-width" in "".join(reader.of("content", "meta"))
    assert "@media print" in path.read_text(encoding="utf-8")


def test_charts_and_pictures_are_inside(reader):
    assert reader.seen.count("svg") == 4  # two cases by work and by wall time; the refused one has none
    pictures = reader.of("src", "img")
    assert len(pictures) == 2
    assert all(base64.b64decode(value.partition(",")[2]) == PICTURE for value in pictures)
    assert reader.of("alt", "img") == ["orbit: the start", "my_scene.py: the start"]


def test_it_says_what_was_done_and_what_to_choose(text):
    for part in (
        "carom trade orbit --note '<b>&'",
        "a processor, Linux; python 3.13",
        "A planet & its sun: one period <1 s>.",
        "own runs of rk4 and yoshida4",
        'Settings(dt=1/480, integrator="yoshida4") # 1e-6, carom',
        "space.iterations = 10; space.step(1/480) # 1 %, pymunk",
        "explicit euler, step 1/30 s: 2 of 64 escaped",
        "not measured: there is no wall whose pressure could be measured",
        "two starts 1e-9 apart are 0.3 apart at the end",
        "2.00 (2)",
        "0.00625 ± 3e-4",
        "bouncing: published",
    ):
        assert part in text


def test_every_point_has_its_row(reader):
    # headings of five tables, all points, published results, and four targets for two engines and for one
    assert reader.seen.count("tr") == 5 + (42 + 9) + 20 + (8 + 4)


def test_another_norm_can_be_chosen(tmp_path):
    page = write_page(made.trade(made.smooth(timed=False)), tmp_path / "page.html", norm="energy").read_text("utf-8")
    assert "orbit: energy, and work per simulated second" in page
    with pytest.raises(Problem, match="no case here has the norm 'speed'"):
        write_page(made.trade(), tmp_path / "page.html", norm="speed")


def test_what_cannot_be_read_or_written_is_a_problem(tmp_path, picture):
    refused = made.trade(made.refused())
    (tmp_path / "file").write_text("")
    (tmp_path / "film.mp4").write_text("")
    with pytest.raises(Problem, match="file"):
        write_page(refused, tmp_path / "file" / "page.html")
    with pytest.raises(Problem, match=r"missing\.png"):
        write_page(refused, tmp_path / "page.html", {"my_scene.py": [tmp_path / "missing.png"]})
    with pytest.raises(Problem, match=r"film\.mp4: a picture of the page must end in \.png"):
        write_page(refused, tmp_path / "page.html", {"my_scene.py": [tmp_path / "film.mp4"]})


def test_without_matplotlib_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.delitem(sys.modules, "carom.lab.trading.charts", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(Problem, match=r"carom\[plot\]"):
        write_page(made.trade(made.refused()), tmp_path / "page.html")
