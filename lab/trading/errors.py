"""The reference of a scene, and the norms: the error of a run against it, and how much of it a player would notice."""

from __future__ import annotations

import dataclasses
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..cli.usage_errors import Problem, did_you_mean
from ..measure.bodies import apart
from ..measure.observer import BLEW_UP, MISSED, NOT_FINITE, RunResult, mean_of
from ..reporting.text import metres
from .grid import STILL, Facts

AT_ONCE = 0.01  # s: contacts this close have no order
CONSERVED = 1e-6  # a reference with a relative energy change below this conserves energy
NO_ENERGY = 1e-3  # relative to the largest kinetic energy: a smaller total is no useful scale
EXPLAINED = 3.0  # times what half of the step changes: as far as a method of first order may be from what is right
FAR = 1e3  # times the reach of the reference, or a size: a body farther away has blown up
TRUSTED = 10.0  # an error counts as measured if it is so many times the reference's own

SHARE = 0.01  # of a body's size, of a number, or of the energy in a minute: less is not noticed
SPEED = 0.02  # sizes per second
LATE = 0.01  # s
OF_SPREAD = 0.5  # of the spread from game to game
CHANCE = (12.7, 4.3, 3.2, 2.8, 2.6, 2.4, 2.4, 2.3, 2.3, 2.2)  # standard errors, 5 %, from 1 degree of freedom on
OF_MANY = 2.0  # standard errors, from many
NEVER = 1e9  # times the limit: only one of the runs has the value

Measure = Callable[[RunResult, RunResult], Any]


class Figure(NamedTuple):
    """Of a setting in one norm, at the worst of its runs: the error relative to the norm's scale, of statistics the
    mean plus two standard errors; how many times what a player would notice; and in words."""

    error: float
    times: float
    text: str


class Norm(NamedTuple):
    """``measure``: run, reference -> how much it is off, in the unit of ``scale`` and of ``limit``, from which on it is
    noticed; ``words`` for a player; ``text``: the quantity, and what 1 is.

    by_body: single bodies are compared, which chaos does not allow; mean: over all runs, of which one alone is chance;
    needs: the field of the reference without which there is nothing to compare
    """

    text: str
    measure: Measure
    scale: Measure
    limit: Measure = lambda seen, right: math.inf
    words: Callable[[float, RunResult, RunResult], str] = lambda value, seen, right: ""
    by_body: bool = False
    mean: bool = False
    needs: str = ""

    def noticed_from(self, name: str, seen: RunResult, right: RunResult) -> float:
        """The limit; infinite where bodies came and went, or cannot be compared, for all but what a game compares."""
        if name not in right.values:
            doubtful = name != "position" and right.doubt > right.tolerance
            places = any(len(value) > 1 for value in right.values.values())  # the game itself says which ones count
            if not seen.fixed or (self.by_body and (doubtful or places)):
                return math.inf
        return self.limit(seen, right)


# -- what is measured -----------------------------------------------------------------------------------------------


def distances(seen: RunResult, right: RunResult) -> tuple[np.ndarray, np.ndarray]:
    """How far each body that both runs have ends from where it should, (n,), and their ids."""
    return apart((seen.entities, seen.position), (right.entities, right.position))


def other_touches(seen: RunResult, right: RunResult) -> list[tuple[int, int, str]]:
    """Pairs of bodies that touch in one of the runs only, or in another order than in the reference."""
    mine, should = ({(a, b): at for a, b, at in one.touches} for one in (seen, right))
    found = [(*pair, "never touches") for pair in should if pair not in mine]
    found += [(*pair, "should not touch") for pair in mine if pair not in should]
    latest = -math.inf
    for pair in sorted(mine.keys() & should.keys(), key=lambda pair: (mine[pair], should[pair])):
        if should[pair] < latest - AT_ONCE:
            found.append((*pair, "touches out of turn"))
        latest = max(latest, should[pair])
    return found


def conserves(right: RunResult) -> bool:
    """True if the scene conserves energy according to the reference."""
    return right.energy_worst <= CONSERVED * (right.energy_scale or 1.0)


def _energy_scale(seen: RunResult, right: RunResult) -> float:
    """The largest kinetic energy, or the energy at the start if smaller, since the zero of the energy is arbitrary."""
    kinetic, total = right.energy_scale or seen.energy_scale or 1.0, abs(right.energy_start)
    return min(kinetic, total) if total > NO_ENERGY * kinetic else kinetic


def _impact_time(seen: RunResult, right: RunResult) -> float:
    count = max(len(seen.times), len(right.times))
    mine, should = (times + [right.seconds] * (count - len(times)) for times in (seen.times, right.times))
    return float(np.abs(np.subtract(mine, should)).max(initial=0.0))


def difference(seen: RunResult, right: RunResult, name: str) -> float:
    """What a game compares against the right value: of numbers the difference, of places the distance; +-inf if only
    one of the runs has it."""
    mine, should = (np.array(one.values.get(name, [math.nan])) for one in (seen, right))
    has, wanted = not np.isnan(mine).any(), not np.isnan(should).any()
    if not (has and wanted):
        return math.inf * (has - wanted) if has or wanted else 0.0
    return float(mine[0] - should[0]) if len(should) == 1 else float(np.linalg.norm(mine - should))


def _reach(seen: RunResult, right: RunResult) -> float:
    return right.reach or seen.reach or 1.0


def _where_any(limit: float) -> Measure:
    """That limit if both runs have impacts: what hardly bounces may come to rest without one."""
    return lambda seen, right: limit if seen.times and right.times else math.inf


def _relative(field: str, text: str, **more: Any) -> Norm:
    """A quantity whose right value is 1."""
    value = operator.attrgetter(field)
    return Norm(
        text, lambda seen, right: value(seen) - value(right),
        lambda seen, right: abs(value(right)) or abs(value(seen)) or 1.0, needs=field, **more,
    )  # fmt: skip


def _own(field: str, text: str, **more: Any) -> Norm:
    """A quantity that should be 0."""
    return Norm(text, lambda seen, right: getattr(seen, field), _one, **more)


def _ends(value: float, seen: RunResult, right: RunResult) -> str:
    ways, ids = distances(seen, right)
    return f"entity {ids[int(np.argmax(ways))]} ends {metres(value)} from where it should"


def _touching(value: float, seen: RunResult, right: RunResult) -> str:
    one, other, how = other_touches(seen, right)[0]
    return f"entity {one} {how} entity {other}{f' ({value:.0f} such pairs)' if value > 1 else ''}"


def _one(seen: RunResult, right: RunResult) -> float:
    return 1.0


NORMS: Mapping[str, Norm] = {
    "position": Norm(
        "largest distance of a body from where it should be in the end; 1 is the longest way of a body from its start",
        lambda seen, right: float(distances(seen, right)[0].max(initial=0.0)), _reach,
        lambda seen, right: max(right.tolerance, 2 * right.doubt), _ends, by_body=True,
    ),
    "energy": Norm(
        "largest departure of the energy on the way (in the end, where it is not conserved); 1 is the energy at the "
        "start, or the largest kinetic energy if that is smaller",
        lambda seen, right: seen.energy_worst if conserves(right) else seen.energy - right.energy, _energy_scale,
    ),
    "energy_gain": Norm(
        "energy gained in a minute, where it is conserved (a loss looks like drag); 1 as for energy",
        lambda seen, right: max(seen.energy - seen.energy_start, 0.0) * 60 / seen.seconds, _energy_scale,
        lambda seen, right: SHARE * _energy_scale(seen, right) if conserves(right) else math.inf,
        lambda value, seen, right: f"the energy grows by {100 * value / _energy_scale(seen, right):.2g} % a minute",
        mean=True,
    ),
    "apex": _relative(
        "apex", "height of the highest point reached, at steps; 1 is the right height", by_body=True,
        limit=lambda seen, right: right.tolerance,
        words=lambda value, *_: f"the highest point is {metres(value)} {'higher' if value > 0 else 'lower'}",
    ),
    "impact_time": Norm(
        "largest error of an impact's time, a missing one being at the end; 1 is the whole run", _impact_time,
        lambda seen, right: right.seconds, by_body=True, needs="times",
    ),
    "first_contact": Norm(
        "error of the first impact's time; 1 is the whole run",
        lambda seen, right: (seen.times or [right.seconds])[0] - (right.times or [right.seconds])[0],
        lambda seen, right: right.seconds, _where_any(LATE),
        lambda value, *_: f"the first contact is {1e3 * abs(value):.3g} ms {'late' if value > 0 else 'early'}",
        by_body=True, needs="times",
    ),
    "count": _relative(
        "impacts", "number of impacts; 1 is the right number", by_body=True, limit=_where_any(0.5),
        words=lambda value, *_: f"{abs(value)} impacts {'more' if value > 0 else 'fewer'}",
    ),
    "order": Norm(
        "pairs that first touch in another order, or in one of the runs only; 1 is as many as should touch",
        lambda seen, right: len(other_touches(seen, right)), lambda seen, right: max(len(right.touches), 1),
        lambda seen, right: math.inf if _rests(right) else 0.5, _touching, by_body=True, needs="touches",
    ),
    "energy_square": _own("energy_square", "mean square of the departure of the energy, in J²: relative to nothing"),
    "overlap": _own(
        "overlap", "deepest overlap in the second half, in sizes of the smaller body",
        limit=lambda seen, right: right.tolerance / seen.size,
        words=lambda value, seen, _: f"bodies sink {metres(value * seen.size)} into each other",
    ),
    "speed": _own(
        "speed", "largest speed in the end, in sizes of the smallest body per second",
        limit=lambda seen, right: SPEED if _rests(right) else math.inf,
        words=lambda value, seen, _: f"what rests still moves at {metres(value * seen.size)} per second",
    ),
    "drift": _own("drift", "largest distance that a body gets in the second half, in sizes of the smallest body"),
    "pressure": _relative("pressure", "mean force on all that stands still, after the first fifth", mean=True),
    "rate": _relative("rate", "impacts per second, after the first fifth; 1 is the right rate", mean=True),
    "kinetic": _relative("kinetic", "kinetic energy in the end; 1 is the right one", mean=True),
}  # fmt: skip


def _rests(right: RunResult) -> bool:
    return bool(right.struck) and right.speed <= STILL


def game_norm(name: str, place: bool = False, chaotic: bool = False) -> Norm:
    """Of a number, or a place, that a game compares by that name."""

    def scale(seen: RunResult, right: RunResult) -> float:
        values = [abs(one.values.get(name, [math.nan])[0]) for one in (right, seen)]
        return _reach(seen, right) if place else next((size for size in values if 0 < size < math.inf), 1.0)

    def limit(seen: RunResult, right: RunResult) -> float:
        value = right.values[name][0]
        return right.tolerance if place else max(SHARE * abs(value), 0.5 if value % 1 == 0 else 0.0)

    def words(value: float, seen: RunResult, right: RunResult) -> str:
        should = right.values[name][0]
        if math.isinf(value):
            return f"{name}: {'one, and there should be none' if value > 0 else f'none instead of {should:.4g}'}"
        if math.isnan(should):
            return f"{name}: none, as it should be"
        if place:
            return f"{name} ends {metres(value)} from where it should"
        if chaotic:
            spread = right.spread.get(name, 0.0)
            return f"{name}: {should + value:.4g} on average instead of {should:.4g}, {spread:.2g} from game to game"
        return f"{name}: {should + value:.4g}{f' instead of {should:.4g}' if value else ', as it should be'}"

    text = f"{name}, {'averaged over the seeds, ' * chaotic}as the game counts it; 1 is the right value"
    return Norm(text, lambda seen, right: difference(seen, right, name), scale, limit, words, place, chaotic)


def norms_for(facts: Facts, asked: Sequence[str]) -> tuple[dict[str, Norm], tuple[str, ...]]:
    """All norms of a scene, and the names of those that are shown, the first counts; Problem for one that there is not,
    or that would measure chance."""
    values = facts.trial.values
    known = {**NORMS, **{one: game_norm(one, len(value) > 1, facts.chaotic) for one, value in values.items()}}
    for one in asked:
        if one not in known:
            raise Problem(f"no norm {one!r}{did_you_mean(one, known)}")
    usual = ("overlap", "speed", "drift") if facts.rests else ("position", "energy", "count")
    usual = usual if facts.rests or facts.trial.impacts else usual[:2]
    if facts.chaotic:
        usual = ("pressure", "rate", "kinetic") if facts.contacts else ()
        known = {one: norm for one, norm in known.items() if not norm.by_body}
    chosen = tuple(asked or values or usual)
    found = tuple(one for one in chosen if one in known)
    if not found or (asked and found != chosen):
        raise Problem(
            f"{facts.task.subject.name} is chaotic: {facts.why}, so places would measure chance: take a shorter time, "
            "statistics (pressure, rate, kinetic: they need contacts), or let compared give numbers too"
        )
    return known, found


# -- the reference --------------------------------------------------------------------------------------------------


def failure_of(seen: RunResult, right: RunResult, chaotic: bool) -> str | None:
    """The reason why the run has no error figure, or None.

    Missed: a body that touches something in the reference has touched nothing; it has passed through it or beside it.
    """
    if seen.failure or not np.isfinite(seen.position).all():
        return seen.failure or NOT_FINITE
    if chaotic:
        return None
    if seen.reach > FAR * max(right.reach, right.size):
        return BLEW_UP
    same = seen.fixed and right.fixed and not right.values  # a game tells itself what went wrong
    if same and {*right.struck} & {*right.entities} - {*seen.struck}:
        return MISSED
    return None


def reference_of(
    facts: Facts, norms: Mapping[str, Norm], shown: Sequence[str], seens: Sequence[RunResult]
) -> tuple[RunResult, dict[str, float]]:
    """What is right, and its own error by norm. seens: of a chaotic scene runs of several seeds; else two runs with the
    finest steps, extrapolated to a step of 0 (Richardson), and two of another method. Problem if they have failed, and
    if all norms are 0 throughout."""
    name = facts.task.subject.name
    for seen in seens:
        if seen.failure:
            raise Problem(f"{name} has no reference: its run {seen.failure}{seen.detail and f': {seen.detail}'}")
    if facts.chaotic:
        right = mean_of(seens, [one for one, norm in NORMS.items() if norm.mean and norm.needs])
    else:
        right = _extrapolated(seens[0], seens[1], 4 if facts.exact.integrator == "yoshida4" else 2)
        right = dataclasses.replace(right, doubt=_own_error(NORMS["position"].measure, right, *seens[1:]))
    right = dataclasses.replace(right, tolerance=SHARE * right.size)
    idle = [one for one in shown if norms[one].needs and not getattr(right, norms[one].needs)]
    if len(idle) == len(shown):
        usable = [one for one, norm in norms.items() if not norm.needs or getattr(right, norm.needs)]
        raise Problem(f"{name}: {', '.join(idle)} is 0 throughout; what can be measured here: {', '.join(usable)}")
    agreement = {}
    for one, norm in ((one, norms[one]) for one in shown if one not in idle):
        if norm.scale is _one or (one == "energy" and conserves(right)):  # what is right is known without it
            agreement[one] = 0.0
        elif facts.chaotic:
            errors = [norm.measure(seen, right) for seen in seens]
            agreement[one] = float(np.std(errors, ddof=1)) / math.sqrt(len(errors)) / norm.scale(right, right)
        else:
            agreement[one] = _own_error(norm.measure, right, *seens[1:]) / norm.scale(right, right)
    return right, agreement


def _own_error(
    measure: Measure, right: RunResult, finest: RunResult, other: RunResult, other_finest: RunResult
) -> float:
    """What the extrapolation has changed; or how far another method is, if its own step does not explain that."""
    off = abs(measure(other_finest, right))
    explained = off <= EXPLAINED * abs(measure(other, other_finest))
    return float(max(abs(measure(finest, right)), 0.0 if explained else off))


def _extrapolated(fine: RunResult, finest: RunResult, order: int) -> RunResult:
    """The finest run, with its places, heights and energies as they would be with a step of 0."""
    if fine.entities != finest.entities:
        return finest
    share = 1 / (2**order - 1)
    pairs = {name: (getattr(fine, name), getattr(finest, name)) for name in ("position", "apex", "energy", "kinetic")}
    return dataclasses.replace(finest, **{name: last + share * (last - first) for name, (first, last) in pairs.items()})


def figures_of(
    seens: Sequence[RunResult], right: RunResult, norms: Mapping[str, Norm], chaotic: bool = False
) -> dict[str, Figure]:  # fmt: skip
    """By norm, of the runs of a setting that have not failed."""
    found: dict[str, Figure] = {}
    for name, norm in norms.items() if seens else ():
        if norm.needs and not getattr(right, norm.needs):
            continue
        values = [norm.measure(seen, right) for seen in seens]
        seen, value, more, limit = seens[0], values[0], 0.0, 0.0
        if norm.mean and np.isfinite(values).all():
            value, spread = float(np.mean(values)), float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
            more = 2 * spread / math.sqrt(len(values))
            if chaotic:
                limit = _beyond_chance(max(spread, right.spread.get(name, 0.0)), len(values), right.runs)
        else:
            worst = int(np.argmax(np.abs(values)))
            seen, value = seens[worst], values[worst]
        limit, scale = max(limit, norm.noticed_from(name, seen, right)), norm.scale(seen, right)
        times = abs(value) / limit if limit and math.isfinite(value) else NEVER * (value != 0)
        times *= not norm.mean or len(values) > 1 or chaotic  # the mean over the start phases is not known from one
        error = (abs(value) + more) / scale if math.isfinite(value) else 1.0
        text = norm.words(value, seen, right) if value or name in right.values else ""
        found[name] = Figure(error, min(times, NEVER), text)
    return found


def _beyond_chance(spread: float, runs: int, known: int) -> float:
    """The least difference of the means of so many runs that is more than chance, and large beside what one game
    differs from the next."""
    freedom = known + runs - 2 if runs > 1 else known - 1
    chance = CHANCE[freedom - 1] if 0 < freedom <= len(CHANCE) else OF_MANY
    return spread * max(OF_SPREAD, chance * math.sqrt(1 / runs + 1 / known))
