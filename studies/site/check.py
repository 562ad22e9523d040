"""What holds of every page of the site: links lead somewhere, and none is heavy."""

from __future__ import annotations

import posixpath
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

HEAVIEST = 400_000  # bytes of a page with its pictures, without the style and scripts that all share


class Page(HTMLParser):
    """The anchors of a page, what it links to, and its pictures."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.pictures: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.anchors |= {value for name in ("id", "name") if (value := values.get(name))}
        if tag == "a" and values.get("href"):
            self.links.add(values["href"] or "")
        elif tag in ("img", "source") and values.get("src"):
            self.pictures.add(values["src"] or "")


def findings(site: Path) -> list[str]:
    """A line for every link to nowhere and every page that is too heavy."""
    pages = {path.relative_to(site).as_posix(): Page(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    found = []
    for name, page in sorted(pages.items()):
        if name == "404.html":  # its links begin at the root of a server
            continue
        size = (site / name).stat().st_size
        for link in sorted(page.links | page.pictures):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            goal = posixpath.normpath(posixpath.join(posixpath.dirname(name), unquote(parts.path)))
            if not parts.path:
                goal = name
            elif (site / goal).is_dir():
                goal = posixpath.normpath(posixpath.join(goal, "index.html"))
            if not (site / goal).is_file():
                found.append(f"{name}: {link} does not exist")
            elif parts.fragment and goal in pages and unquote(parts.fragment) not in pages[goal].anchors:
                found.append(f"{name}: {link}: no such anchor")
            elif link in page.pictures:
                size += (site / goal).stat().st_size
        if size > HEAVIEST:
            found.append(f"{name}: {size / 1000:.0f} KB with its pictures, more than {HEAVIEST / 1000:.0f}")
    return found
