"""The tables: false positives of each option, pairs tested, and cost."""

from __future__ import annotations

from ...bench.report import digits
from ...reporting.text_tables import TextTable
from ...wording import NOTHING
from .records import GeometryCost, GeometryStudy
from .study import OPTIONS

BOUNDS = ("sphere", "box")  # the options with one cheap level, which are compared


def tables(result: GeometryStudy) -> list[TextTable]:
    """All tables of the result."""
    return [shares(result), counts(result), costs(result)]


def shares(result: GeometryStudy) -> TextTable:
    """Shares of false positives, and the cheap shape with fewer."""
    rows = [
        (*heading, *(percent(result.cost(*case, option).share) for option in result.options), better(result, *case))
        for heading, case in _rows(result)
    ]
    title = "false positives: contacts reported of objects that do not overlap, in % of those reported"
    return TextTable(title, ("object", "", *result.options, "better alone"), rows, words=2)


def counts(result: GeometryStudy) -> TextTable:
    """Pairs tested, passed by the first level, reported."""

    def cell(cost: GeometryCost) -> str:
        figures = [cost.tested, *[cost.first_hits] * (len(OPTIONS[cost.option]) > 1), cost.hits]
        return " / ".join(f"{100 * figure / cost.objects:.0f}" for figure in figures)

    rows = [
        (*heading, *(cell(result.cost(*case, option)) for option in result.options)) for heading, case in _rows(result)
    ]
    title = "pairs per 100 objects: tested / passed by the first of two levels / reported"
    return TextTable(title, ("object", "", *result.options), rows, words=2)


def costs(result: GeometryStudy) -> TextTable:
    """Nanoseconds per pair and per object."""

    def cell(cost: GeometryCost) -> str:
        return f"{digits(cost.nanoseconds.median)} / {digits(cost.finding.median)}"

    rows = [
        (*heading, *(cell(result.cost(*case, option)) for option in result.options)) for heading, case in _rows(result)
    ]
    title = f"ns per pair tested, narrow phase / ns per object, broad and narrow phase; medians of {result.repeats}"
    return TextTable(title, ("object", "", *result.options), rows, words=2)


def remarks(result: GeometryStudy) -> list[str]:
    """How the result was checked, and the machine."""
    misses = sum(cost.misses for cost in result.costs)
    touching = sum(result.cost(*case, result.options[0]).touching for case in result.cases)
    checked = f"misses: {misses} of the {touching:,} overlapping pairs with any option"
    if "precise" in result.options:
        checked += "; the precise level and the separating axes agree on every pair"
    off = [abs(cost.share - cost.expected_share) for cost in result.costs if cost.expected_share is not None]
    if off:
        checked += f"; the shares differ from their closed forms by at most {100 * max(off):.1f} % of the hits"
    setup = f"{result.worlds} worlds of {result.count:,} objects, {result.room:g} m2 for each object of 1 m2"
    return [checked, f"{setup}, seed {result.seed}; {result.machine['processor']}, {result.machine['clock']}"]


def better(result: GeometryStudy, thing: str, turned: bool) -> str:
    """The cheap shape with fewer false positives, used alone."""
    tried = [option for option in BOUNDS if option in result.options]
    return min(tried, key=lambda option: result.cost(thing, turned, option).share, default=NOTHING)


def attitude(turned: bool) -> str:
    """"turned" or "upright", in words."""
    return "turned" if turned else "upright"


def percent(value: float) -> str:
    """A share as a percentage."""
    return f"{100 * value:.0f}"


def _rows(result: GeometryStudy) -> list[tuple[tuple[str, str], tuple[str, bool]]]:
    """The row headings, and the case of each row."""
    return [((thing, attitude(turned)), (thing, turned)) for thing, turned in result.cases]
