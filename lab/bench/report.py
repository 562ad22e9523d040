"""The tables of ``carom bench``: times and ratios, quality figures, and the settings of both engines."""

from __future__ import annotations

import importlib.metadata
import platform
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..measure.timing import CLOCK, Spread
from ..plain import JsonRecord
from ..reporting.text import NOTHING, TextTable, compact, number, span

CAROM_SETTINGS = ("dt", "integrator", "collision", "substeps")
PYMUNK_SETTINGS = ("iterations", "collision_slop", "collision_bias", "damping", "threads", "sleeping")


def tables(result: Result) -> list[TextTable]:
    """All tables of the result."""
    steps = [row for row in result.rows if row.energy]
    stacks = [row for row in steps if row.energy == "left"]
    queries = [row for row in result.rows if row.unit != "step"]
    made = [times(result.rows, result.repeats)]
    if steps:
        made.append(quality(steps))
    if stacks:
        made.append(motion(stacks))
    if queries:
        made.append(answers(queries))
    return made


def times(rows: list[Row], repeats: int) -> TextTable:
    """Milliseconds and ratios."""

    def median(spread: Spread | None) -> str:
        return compact(spread.median) if spread else NOTHING

    cells = [
        (
            row.label, median(row.carom_ms), median(row.peer_ms), row.peer_index or NOTHING, median(row.ratio),
            span(row.ratio) if row.ratio else NOTHING,
        )
        for row in rows
    ]  # fmt: skip
    what = "ms per 1,000 queries" if rows and all(row.unit != "step" for row in rows) else "ms per step"
    if len({row.unit for row in rows}) > 1:
        what = "ms per step, of player_query per 1,000 queries"
    medians = f"medians of {repeats} repeats" if repeats > 1 else "one repeat"
    title = f"{what}: {medians}; ratio: pymunk's median over carom's"
    return TextTable(title, ("scene", "carom", "pymunk", "index", "ratio", "from .. to"), cells)


def of_both(row: Row, name: str, scale: float = 1.0, digits: int = 3) -> str:
    """That figure of both engines in one cell."""
    return " / ".join(compact(scale * figures[name], digits) for figures in row.quality.values())


def quality(rows: list[Row]) -> TextTable:
    """Quality of the states reached in the timed steps, carom first."""
    cells = []
    for row in rows:
        energy = f"{of_both(row, 'kinetic_end')} J"
        if row.energy == "kept":  # else it may be 0 at the start
            kept = [f"{100 * one['kinetic_end'] / one['kinetic_start']:.3f}" for one in row.quality.values()]
            energy = f"{' / '.join(kept)} %"
        overlaps = (of_both(row, name, 100, 2) for name in ("overlap_mean", "overlap_max"))
        escaped = " / ".join(f"{one['escaped']:.0f}" for one in row.quality.values())
        cells.append((row.label, energy, *overlaps, escaped))
    engines = " / ".join(rows[0].quality)
    title = f"quality, {engines}: kinetic energy kept or left, overlaps in % of a diameter, bodies escaped"
    return TextTable(title, ("scene", "kinetic energy", "mean overlap", "deepest", "escaped"), cells)


def motion(rows: list[Row]) -> TextTable:
    """The largest displacement of bodies that should come to rest."""
    cells = [(row.label, *(of_both(row, name) for name in ("drift", "sink", "creep"))) for row in rows]
    engines = " / ".join(rows[0].quality)
    title = f"farthest way from the start, {engines}: sideways and downwards; after a tenth of the steps: in all, in m"
    return TextTable(title, ("scene", "sideways", "downwards", "after a tenth"), cells)


def answers(rows: list[Row]) -> TextTable:
    """The figures of the queries, which show that both engines ran the same ones."""
    cells = []
    for row in rows:
        ((figure, _), *_) = next(iter(row.quality.values())).items()
        cells.append((row.label, figure, *(f"{of[figure]:,.6g}" for of in row.quality.values())))
    return TextTable("answers to 1,000 queries", ("scene", "what", *rows[0].quality), cells, words=2)


def remarks(result: Result) -> list[str]:
    """Machine and engine settings, one line each."""
    compiling = sum({(row.name, row.bodies): row.compile_seconds for row in result.rows}.values())
    lines = [machine_line(result.machine), f"compiling and loading kernels: {compiling:.1f} s, not counted"]
    for engine, names in (("carom", CAROM_SETTINGS), ("pymunk", PYMUNK_SETTINGS)):
        values = result.settings.get(engine)
        if values:
            lines.append(f"{engine}: {', '.join(f'{name} {_value(values[name])}' for name in names)}")
            if engine == "carom":
                others = {row.name: row.settings for row in result.rows if row.settings}  # that are not the default
                for scene, values in others.items():
                    lines[-1] += f"; {scene}: {', '.join(f'{name} {_value(value)}' for name, value in values.items())}"
    if "pymunk" in result.settings:
        lines[-1] += (
            "; moments of what does not spin infinite; index: its tree of boxes or its spatial hash (cells of two"
            " diameters), whichever was faster in the first repeat"
        )
    return lines


def _value(value: Any) -> str:
    return number(value) if isinstance(value, float) else str(value)


PACKAGES = ("carom", "numba", "numpy", "esper", "pymunk")


@dataclass
class Row(JsonRecord):
    """One window of one scene at one size, or one kind of query.

    ``unit``: what the milliseconds are per; medians of the steps of a repeat. ``ratio``: pymunk's median over carom's,
    within each repeat.
    ``peer_index``: the pymunk index that was faster in the first repeat; the times are those with it.
    ``settings``: carom's settings that differ from the default.
    ``quality``: figures by engine and name, see ``against_pymunk.Quality.figures``.
    """

    scene: str
    variant: str
    bodies: int
    window: str
    unit: str
    timed: int
    energy: str
    carom_ms: Spread
    peer_ms: Spread | None = None
    ratio: Spread | None = None
    peer_index: str | None = None
    compile_seconds: float = 0.0
    settings: dict[str, Any] = field(default_factory=dict)
    quality: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return f"{self.scene}, {self.variant}" if self.variant else self.scene

    @property
    def label(self) -> str:
        """Scene, bodies, and the variant that distinguishes the row."""
        return " ".join(filter(None, (self.scene, f"{self.bodies:,}", self.variant, self.window)))


@dataclass
class Result(JsonRecord):
    """A whole benchmark: machine, settings and rows."""

    machine: dict[str, str]
    settings: dict[str, dict[str, Any]]
    repeats: int
    rows: list[Row]


def machine() -> dict[str, str]:
    """The environment of the measurement: processor, versions, clock."""
    versions = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = "missing"
    return {"processor": _processor(), "system": platform.system(), "clock": CLOCK, **versions}


def machine_line(machine: dict[str, str]) -> str:
    """Processor and system, then versions, then the clock."""
    others = ("processor", "system", "clock")
    versions = ", ".join(f"{name} {version}" for name, version in machine.items() if name not in others)
    return f"{machine['processor']}, {machine['system']}; {versions}; {machine['clock']}"


def _processor() -> str:
    """The processor's name; on Linux from /proc, because Python does not provide it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
