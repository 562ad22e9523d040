"""Records of a trade of accuracy for speed: the settings tried, the result of each run, and the summary.

Everything here is plain data that converts to JSON and back.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Self

from ...framework import Settings
from ..measure.timing import Spread
from ..plain import Plain

CAROM, PYMUNK = "carom", "pymunk"
SMOOTH, IMPACTS, RESTING, CHAOTIC = "smooth", "impacts", "resting", "chaotic"  # kinds of scenes

# Failures of runs; STOPPED: ended by an error.
NOT_FINITE, ESCAPED, TUNNELLED, BLEW_UP, STOPPED = "not finite", "escaped", "tunnelled", "blew up", "stopped"
FIELDS = ("integrator", "collision", "substeps", "geometry")  # of a cell, besides the step
ENOUGH = 2  # settings with this many times fewer runs than others are not told of
TRUSTED = 10.0  # an error counts as measured if the references agree better by this factor


@dataclass(frozen=True)
class Cell:
    """One point of the grid of settings.

    For pymunk, ``substeps`` are the iterations of its solver and ``integrator`` is its own.
    """

    dt: float
    integrator: str = "semi_implicit_euler"
    collision: str = "discrete"
    substeps: int = 4
    geometry: str = "precise"
    engine: str = CAROM

    @classmethod
    def of(cls, settings: Settings) -> Cell:
        """carom with these settings."""
        return cls(settings.dt, *(getattr(settings, name) for name in FIELDS))

    def settings(self, base: Settings) -> Settings:
        """``base`` with these fields; ValueError if Settings rejects one."""
        return base.replace(dt=self.dt, **{name: getattr(self, name) for name in FIELDS})

    @property
    def method(self) -> Cell:
        """Identifies the curve of this point: the same fields with a step of 1 s."""
        return dataclasses.replace(self, dt=1.0)

    def differences(self, other: Cell) -> int:
        """How many fields besides the step differ."""
        return sum(getattr(self, name) != getattr(other, name) for name in FIELDS)

    @property
    def key(self) -> str:
        """A unique word for the cell."""
        return "/".join(str(value) for value in dataclasses.astuple(self))


@dataclass(frozen=True)
class ErrorBar:
    """An error over all repeats: mean, least, largest, and the standard error of the mean.

    For statistics, where single repeats are noise, low and high are the mean minus and plus two standard errors.
    """

    mean: float
    low: float
    high: float
    uncertainty: float

    @classmethod
    def of(cls, values: Sequence[float], signed: bool = False) -> Self:
        """From at least one value; with a single value the uncertainty is unknown: 0. signed: for statistics."""
        spread = statistics.stdev(values) if len(values) > 1 else 0.0
        mean, uncertainty = statistics.fmean(values), spread / math.sqrt(len(values))
        if not signed:
            return cls(mean, min(values), max(values), uncertainty)
        return cls(abs(mean), max(abs(mean) - 2 * uncertainty, 0.0), abs(mean) + 2 * uncertainty, uncertainty)


@dataclass
class Point(Plain):
    """One cell over all its repeats.

    errors: by norm, of the repeats that did not fail
    failures: number of failed repeats, by kind
    counts: per simulated second, means over the repeats, the same on every machine: steps, force_evaluations,
    candidates, pairs, impacts, solver_loops
    work: weighted sum of the counts, see :mod:`carom.lab.engines.adapters`; per simulated second
    milliseconds: time per simulated second on this machine; None if it was not timed
    effects: what could be noticed, each at its worst of all repeats, see :mod:`carom.lab.measure.effects`
    line: the code that sets the settings
    alone: timed in turns with others of the answer, and nothing else running
    """

    cell: Cell
    repeats: int
    errors: dict[str, ErrorBar]
    failures: dict[str, int]
    counts: dict[str, float]
    work: float
    milliseconds: Spread | None = None
    effects: dict[str, float] = field(default_factory=dict)
    line: str = ""
    alone: bool = False

    @property
    def failed(self) -> bool:
        return bool(self.failures)

    def meets(self, norm: str, target: float) -> bool:
        """True if no repeat failed and the worst of them meets the target."""
        return not self.failed and norm in self.errors and self.errors[norm].high <= target


@dataclass
class Curve(Plain):
    """One method: its points from the largest step to the smallest.

    label: distinguishes it from the other curves of its case
    orders: by norm: the observed order in dt, fitted to the logarithms of the usable errors; None if there is none
    theory: by norm: the order expected from theory; inf for exact (rounding only); None if unknown
    """

    label: str
    points: list[Point]
    orders: dict[str, float | None] = field(default_factory=dict)
    theory: dict[str, float | None] = field(default_factory=dict)


@dataclass
class Reference:
    """What the errors are measured against.

    text: one sentence: a closed form by name, or own runs and how well they agree
    agreement: by norm: the difference between two methods; 0 for a closed form. Errors below TRUSTED times this are not
    reliable
    spread: by norm, for statistics: the standard deviation of a single run
    """

    text: str
    agreement: dict[str, float] = field(default_factory=dict)
    spread: dict[str, float] = field(default_factory=dict)

    def is_statistic(self, norm: str) -> bool:
        """True if single repeats are noise, so that a limit applies to the mean plus two standard errors."""
        return norm in self.spread

    def trusts(self, norm: str, error: float) -> bool:
        """True if an error of that size can be distinguished from the reference's own."""
        return error >= TRUSTED * self.agreement.get(norm, 0.0)


@dataclass
class CaseTrade(Plain):
    """One scene with all its curves.

    scene: its name, or the file's; ``target``: the name on the command line
    kind: SMOOTH, IMPACTS, RESTING or CHAOTIC; ``why``: how it was determined
    norms: quantity and scale, by name; charts and answers use the first one
    repeated: what differs between repeats: "start phases" or "seeds"
    refused: why nothing was measured, else ""
    own: the settings that the scene has; scale: what the main norm is relative to, in the scene's units
    inputs: the effects of recorded inputs that act in whole steps, by the length of the step in s: that of the scene's
    own settings and that of the answer; none without inputs
    """

    scene: str
    target: str
    description: str
    kind: str
    why: str
    norms: dict[str, str]
    seconds: float
    repeats: int
    repeated: str
    reference: Reference
    curves: list[Curve]
    refused: str = ""
    own: Cell | None = None
    scale: float = 1.0
    inputs: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def norm(self) -> str:
        return next(iter(self.norms))

    @property
    def points(self) -> list[Point]:
        """Those of all curves."""
        return [point for curve in self.curves for point in curve.points]

    @property
    def usable(self) -> list[Point]:
        """carom's points without failures, of which enough runs are known."""
        points = [point for point in self.points if point.cell.engine == CAROM]
        return known_well(point for point in points if not point.failed and self.norm in point.errors)


@dataclass
class Trade(Plain):
    """All cases of one call, on one machine; ``command`` reproduces it."""

    machine: dict[str, str]
    command: str
    cases: list[CaseTrade]

    def as_dict(self) -> dict[str, Any]:
        """For JSON, which cannot represent infinity: an inf order of theory becomes the string "exact"."""
        plain = dataclasses.asdict(self)
        for case in plain["cases"]:
            for curve in case["curves"]:
                curve["theory"] = {k: "exact" if v == math.inf else v for k, v in curve["theory"].items()}
        return plain

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> Self:
        """The inverse of :meth:`as_dict`, also after JSON."""
        trade = super().from_dict(plain)
        for case in trade.cases:
            for curve in case.curves:
                curve.theory = {k: math.inf if v == "exact" else v for k, v in curve.theory.items()}
        return trade


def observed_order(steps: Sequence[float], errors: Sequence[float]) -> float | None:
    """The slope of log error over log dt by least squares; None for fewer than two usable points.

    dt s; errors of any unit. Both Euler methods give 1, velocity Verlet 2, Runge-Kutta 4 gives 4.
    """
    usable = [(math.log(dt), math.log(e)) for dt, e in zip(steps, errors, strict=True) if e > 0 and math.isfinite(e)]
    if len(usable) < 2:
        return None
    x, y = zip(*usable, strict=True)
    return statistics.linear_regression(x, y).slope


def known_well(points: Iterable[Point]) -> list[Point]:
    """Those with at least half as many runs as the one with most: less is known of the worst of the others."""
    points = list(points)
    most = max((point.repeats for point in points), default=0)
    return [point for point in points if ENOUGH * point.repeats >= most]


def by_method(points: Iterable[Point]) -> Mapping[Cell, list[Point]]:
    """The points of each curve, from the largest step to the smallest."""
    curves: dict[Cell, list[Point]] = {}
    for point in points:
        curves.setdefault(point.cell.method, []).append(point)
    return {method: sorted(found, key=lambda point: -point.cell.dt) for method, found in curves.items()}


# -- a point as a line of Python -------------------------------------------------------------------------


LARGEST_NUMERATOR = 16  # 2/45 is easy to read, 347/20820 is not
LARGEST_DENOMINATOR = 1_000_000


def settings_line(cell: Cell, base: Settings | None = None) -> str:
    """The shortest ``Settings(...)`` that is ``cell.settings(base)``, with identical values, bit for bit.

    Fields with their default values are left out. ``base``: Settings() if None. ValueError for another engine's cell,
    and for values that Settings rejects.
    """
    if cell.engine != CAROM:
        raise ValueError(f"a cell of {cell.engine} has no Settings")
    chosen, usual = cell.settings(base or Settings()), Settings()
    parts = []
    for name in (each.name for each in dataclasses.fields(Settings)):
        value = getattr(chosen, name)
        if value != getattr(usual, name):
            parts.append(f"{name}={seconds(value) if name == 'dt' else quoted(value)}")
    return f"Settings({', '.join(parts)})"


def python_line(cell: Cell, base: Settings | None = None) -> str:
    """The code that sets ``cell`` in its engine: :func:`settings_line`, or pymunk's two statements in one line."""
    if cell.engine == CAROM:
        return settings_line(cell, base)
    return f"space.iterations = {cell.substeps}; space.step({seconds(cell.dt)})"


def seconds(dt: float) -> str:
    """A step as Python source: an exactly equal small fraction, unless it is longer than the decimal number."""
    dt = float(dt)
    plain = repr(dt)
    fraction = Fraction(dt).limit_denominator(LARGEST_DENOMINATOR)
    text = f"{fraction.numerator}/{fraction.denominator}"
    small = 0 < fraction.numerator <= LARGEST_NUMERATOR and fraction.denominator > 1
    same = small and fraction.numerator / fraction.denominator == dt
    return text if same and len(text) <= len(plain) else plain


def quoted(value: object) -> str:
    """The Python repr, with the quotation marks used in the documentation."""
    if isinstance(value, str) and value.isprintable() and '"' not in value and "\\" not in value:
        return f'"{value}"'
    return repr(value)
