"""A trade as one self-contained HTML file, with charts and pictures embedded."""

from __future__ import annotations

import base64
import importlib
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from ..cases.published import published
from ..commands.usage_errors import Problem
from ..reporting.text_tables import TextTable
from .records import CaseTrade, Trade
from .report import (
    case_remarks,
    cheapest,
    check_norm,
    choice_lines,
    failure_lines,
    machine_line,
    norm_of,
    points_table,
    published_table,
)

KINDS = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".svg": "image/svg+xml"}
CHART_WORDS = {"work": "error against work", "time": "error against wall time"}

STYLE = """
:root { --back: #0d1117; --text: #e6edf3; --quiet: #8b98a8; --line: #2a3442; --code: #161d28; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 64rem; background: var(--back); color: var(--text);
       font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.35rem; margin-top: 3rem; } h3 { font-size: 1.05rem; }
a { color: inherit; } .quiet { color: var(--quiet); font-size: 0.9rem; }
pre { background: var(--code); padding: 0.6rem; overflow-x: auto; } code { font-family: ui-monospace, monospace; }
figure { margin: 1rem 0; } figcaption { color: var(--quiet); font-size: 0.85rem; }
svg, img { display: block; width: 100%; height: auto; } .pictures { display: grid; gap: 1rem;
       grid-template-columns: repeat(auto-fit, minmax(16rem, 1fr)); }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-size: 0.82rem; }
caption { text-align: left; color: var(--quiet); padding: 0.3rem 0; }
th, td { padding: 0.15rem 0.6rem 0.15rem 0; text-align: right; white-space: nowrap;
         border-bottom: 1px solid var(--line); } .word { text-align: left; }
@media print {
  :root { --back: #fff; --text: #000; --quiet: #444; --line: #bbb; --code: #f2f2f2; }
  body { max-width: none; font-size: 11px; } .wide { overflow: visible; } pre { white-space: pre-wrap; }
  figure, tr { break-inside: avoid; } svg, img { print-color-adjust: exact; }
}
"""

PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>$style</style>
</head>
<body>
<h1>$title</h1>
<p>What the settings of these scenes cost, and how large the error is that they leave.</p>
<pre><code>$command</code></pre>
<p class="quiet">$machine</p>
$contents
$cases
</body>
</html>
""")

CASE = Template("""<section id="$name">
<h2>$scene</h2>
$description
<ul>
$remarks
</ul>
$parts
</section>
""")


def write_page(
    trade: Trade,
    path: Path,
    pictures: Mapping[str, Sequence[Path]] | None = None,
    norm: str | None = None,
    charts: bool = True,
) -> Path:
    """Write the page and return its path.

    ``pictures``: files (PNG, JPEG or SVG) to embed, by scene. ``norm``: used for cases that have it; the others use
    their first one. ``charts``: draw charts, which needs matplotlib. Problem for a norm that no case has, a file that
    cannot be read or written, and for charts without matplotlib.
    """
    check_norm(trade, norm)
    module, shown = chart_module() if charts else None, pictures or {}
    names = [f"case-{number}" for number in range(1, len(trade.cases) + 1)]
    links = [
        f'<li><a href="#{name}">{escape(case.scene)}</a></li>' for name, case in zip(names, trade.cases, strict=True)
    ]
    cases = [
        _case(case, name, module, shown.get(case.scene, ()), norm_of(case, norm))
        for name, case in zip(names, trade.cases, strict=True)
    ]
    page = PAGE.substitute(
        title=escape("Accuracy against speed: " + ", ".join(case.scene for case in trade.cases)),
        style=STYLE,
        command=escape(trade.command),
        machine=escape(machine_line(trade.machine)),
        contents=f"<ul>{''.join(links)}</ul>" if len(links) > 1 else "",
        cases="\n".join(cases),
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise Problem(f"{path}: {error.strerror or error}") from error
    return path


def chart_module() -> Any:
    """The module carom.lab.trading.charts; Problem, with the name of the extra, if matplotlib is missing."""
    try:
        return importlib.import_module(".charts", __package__)
    except ImportError as error:
        raise Problem("no charts, matplotlib is missing; it comes with the extra: pip install 'carom[plot]'") from error


def _case(case: CaseTrade, name: str, charts: Any, pictures: Sequence[Path], norm: str) -> str:
    parts = []
    if not case.refused:
        for quantity in charts.quantities(case) if charts else ():
            drawing = charts.inline_svg(case, quantity, norm, f"{name}-{quantity}-")
            parts.append(_figure(drawing, f"{case.scene}: {CHART_WORDS[quantity]}"))
        parts.append(_heading("What to choose", _cheapest(case, norm)))
        failed = failure_lines(case)
        parts += [_heading("What failed", f"<ul>{_items(failed)}</ul>")] * bool(failed)
        parts.append(_heading("Every point", _table(points_table(case, norm))))
        parts += [_table(published_table(case.scene, norm))] * bool(published(case.scene, norm))
    if pictures:
        shown = "\n".join(_figure(_image(picture, case.scene), picture.stem) for picture in pictures)
        parts.append(_heading("The scene", f'<div class="pictures">{shown}</div>'))
    return CASE.substitute(
        name=name,
        scene=escape(case.scene),
        description=f"<p>{escape(case.description)}</p>" if case.description else "",
        remarks=_items(case_remarks(case, norm)),
        parts="\n".join(parts),
    )


def _cheapest(case: CaseTrade, norm: str) -> str:
    """The table, and below it the lines to paste."""
    lines = "\n".join(f"{line}  # {target}" for target, line in choice_lines(case, norm))
    return _table(cheapest(case, norm=norm)) + (f"<pre><code>{escape(lines)}</code></pre>" if lines else "")


def _heading(text: str, below: str) -> str:
    return f"<h3>{escape(text)}</h3>\n{below}"


def _items(lines: Sequence[str]) -> str:
    return "\n".join(f"<li>{escape(line)}</li>" for line in lines)


def _figure(inside: str, caption: str) -> str:
    return f"<figure>{inside}<figcaption>{escape(caption)}</figcaption></figure>"


def _table(table: TextTable) -> str:
    """A table that scrolls sideways on a narrow screen."""

    words = ' class="word"'

    def row(cells: Sequence[str], tag: str) -> str:
        marked = (
            f"<{tag}{words if place < table.words else ''}>{escape(cell)}</{tag}>"
            for place, cell in enumerate(cells)
        )
        return f"<tr>{''.join(marked)}</tr>"

    body = "\n".join(row(cells, "td") for cells in table.rows)
    head = f"<caption>{escape(table.title)}</caption>\n<thead>{row(table.headings, 'th')}</thead>"
    return f'<div class="wide"><table>{head}\n<tbody>\n{body}\n</tbody></table></div>'


def _image(path: Path, scene: str) -> str:
    """A picture embedded in the page."""
    kind = KINDS.get(path.suffix.lower())
    if kind is None:
        raise Problem(f"{path}: a picture of the page must end in {', '.join(KINDS)}")
    try:
        content = base64.b64encode(path.read_bytes()).decode("ascii")
    except OSError as error:
        raise Problem(f"{path}: {error.strerror or error}") from error
    return f'<img src="data:{kind};base64,{content}" alt="{escape(f"{scene}: {path.stem}", quote=True)}">'
