"""Norms: the error of a run against a reference run, each a number relative to a stated scale.

The norm depends on the kind of scene. Smooth motion: position and energy. Impacts: the state at a fixed time, the times
and the number of impacts. Rest: overlap, residual speed and drift, where the right value is 0. Chaos: statistics only;
their errors keep their sign so that noise averages out over the seeds. A game names its own: what it compares, or with
MEAN before the name the mean of that over the seeds.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..cli.usage_errors import Problem, did_you_mean
from ..trading.records import BLEW_UP, CHAOTIC, IMPACTS, NOT_FINITE, RESTING, SMOOTH, TUNNELLED
from .observation import Seen

MEAN = "mean "  # before the name of what a game compares: over the seeds
AT_ONCE = 0.01  # s: contacts this close have no order
FAR = 1e3  # times the reference's reach: a body farther away has blown up
CONSERVED = 1e-6  # a reference with a relative energy change below this conserves energy
NO_ENERGY = 1e-3  # relative to the largest kinetic energy: a smaller total is no useful scale
Measure = Callable[[Seen, Seen], float]


@dataclass(frozen=True)
class Norm:
    """``text``: the quantity and its scale, in words; ``scale``: the scale in the scene's units.

    signed: a statistic, of which single runs are noise; absolute: in its own unit, without a scale;
    relative_to: the field of ``Seen`` that is the scale, if the right value is 1, or without which there is nothing.
    """

    name: str
    text: str
    measure: Measure
    scale: Measure
    signed: bool = False
    absolute: bool = False
    relative_to: str = ""

    def is_usable_with(self, reference: Seen) -> bool:
        """True if runs can be compared by it: the scale must not be 0."""
        return not self.relative_to or bool(getattr(reference, self.relative_to))


def _reach(seen: Seen, reference: Seen) -> float:
    return reference.reach or seen.reach or 1.0


def matched(seen: Seen, reference: Seen) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions of the bodies that both runs have at the end, by their order of creation, and their ids."""
    mine, right = np.array(seen.entities), np.array(reference.entities)
    if (len(mine) == len(right) and (mine == right).all()) or not len(mine) or not len(right):
        both = min(len(seen.position), len(reference.position))  # a closed form has no ids
        return seen.position[:both], reference.position[:both], mine[:both]
    ids, a, b = np.intersect1d(mine, right, return_indices=True)
    return seen.position[a], reference.position[b], ids


def distances(seen: Seen, reference: Seen) -> tuple[np.ndarray, np.ndarray]:
    """How far each body that both runs have ends from where it should, (n,), and their ids."""
    mine, right, ids = matched(seen, reference)
    return np.sqrt(((mine - right) ** 2).reshape(len(mine), -1).sum(axis=1)), ids


def _position(seen: Seen, reference: Seen) -> float:
    return float(distances(seen, reference)[0].max(initial=0.0)) / _reach(seen, reference)


def other_touches(seen: Seen, reference: Seen) -> list[tuple[int, int, str]]:
    """Pairs that touch in one of the runs only ("never", "touches"), or in another order than in the reference."""
    mine, right = ({(a, b): at for a, b, at in one.touches} for one in (seen, reference))
    found = [(*pair, "never") for pair in right if pair not in mine]
    found += [(*pair, "touches") for pair in mine if pair not in right]
    common = sorted((at, right[pair], pair) for pair, at in mine.items() if pair in right)
    kept = _in_order([time for _, time, _ in common])
    return found + [(*pair, "order") for (_, _, pair), stays in zip(common, kept, strict=True) if not stays]


def _in_order(times: Sequence[float]) -> np.ndarray:
    """True for the members of the longest ascending part, (n,)."""
    right = np.array(times)
    if not len(right) or (right >= np.maximum.accumulate(right) - AT_ONCE).all():
        return np.ones(len(right), bool)
    longest, before = np.ones(len(right), int), np.full(len(right), -1)
    for k in range(1, len(right)):
        usable = np.where(right[:k] <= right[k] + AT_ONCE, longest[:k], 0)
        best = int(np.argmax(usable))
        if usable[best]:
            longest[k], before[k] = usable[best] + 1, best
    kept, k = np.zeros(len(right), bool), int(np.argmax(longest))
    while k >= 0:
        kept[k], k = True, before[k]
    return kept


def _order(seen: Seen, reference: Seen) -> float:
    return len(other_touches(seen, reference)) / max(len(reference.touches), 1)


def energy_scale(seen: Seen, reference: Seen) -> float:
    """The largest kinetic energy, or the energy at the start if smaller, since the zero of the energy is arbitrary."""
    kinetic = reference.energy_scale or seen.energy_scale or 1.0
    total = abs(reference.energy_start)
    return min(kinetic, total) if total > NO_ENERGY * kinetic else kinetic


def conserves(reference: Seen) -> bool:
    """True if the scene conserves energy according to the reference."""
    return reference.energy_worst <= CONSERVED * (reference.energy_scale or 1.0)


def _energy(seen: Seen, reference: Seen) -> float:
    if conserves(reference):
        return seen.energy_worst / energy_scale(seen, reference)
    return abs(seen.energy - reference.energy) / energy_scale(seen, reference)


def _impact_time(seen: Seen, reference: Seen) -> float:
    """The error in time; an impact that only one of the two runs has counts as if the other had it at the end."""
    count = max(len(seen.times), len(reference.times))
    mine, right = (times + [reference.seconds] * (count - len(times)) for times in (seen.times, reference.times))
    return float(np.abs(np.subtract(mine, right)).max(initial=0.0)) / reference.seconds


def _relative(name: str, text: str, attribute: str = "", signed: bool = False) -> Norm:
    """A quantity whose right value is 1; attribute: the field of ``Seen``, if it has another name."""
    attribute = attribute or name

    def scale(seen: Seen, reference: Seen) -> float:
        return abs(getattr(reference, attribute)) or abs(getattr(seen, attribute)) or 1.0

    def measure(seen: Seen, reference: Seen) -> float:
        error = (getattr(seen, attribute) - getattr(reference, attribute)) / scale(seen, reference)
        return error if signed else abs(error)

    return Norm(name, text, measure, scale, signed, relative_to=attribute)


def _own(name: str) -> tuple[Measure, Measure]:
    return (lambda seen, reference: getattr(seen, name)), (lambda seen, reference: 1.0)


NORMS: Mapping[str, Norm] = {
    norm.name: norm
    for norm in (
        Norm("position", "largest distance of a body from where it should be in the end; 1 is the longest way a body "
             "gets from its start", _position, _reach),
        Norm("energy", "largest departure of the energy on the way (in the end, where it is not conserved); 1 is the "
             "energy at the start, or the largest kinetic energy if that is smaller", _energy, energy_scale),
        _relative("apex", "height of the highest point reached, at steps; 1 is the right height"),
        Norm("impact_time", "largest error of an impact's time, a missing one being at the end; 1 is the whole run",
             _impact_time, lambda seen, reference: reference.seconds),
        _relative("count", "number of impacts; 1 is the right number", "impacts"),
        Norm("order", "pairs that touch for the first time in another order, or in one of the runs only; 1 is as many "
             "as should touch", _order, lambda seen, reference: len(reference.touches), relative_to="touches"),
        Norm("energy_square", "mean square of the departure of the energy, in J²: not relative to anything",
             *_own("energy_square"), absolute=True),
        Norm("overlap", "deepest overlap in the second half, in sizes of the smaller body", *_own("overlap")),
        Norm("overlap_mean", "overlap per body in the second half, in sizes of the smaller body",
             *_own("overlap_mean")),
        Norm("speed", "largest speed in the end, in sizes of the smallest body per second", *_own("speed")),
        Norm("drift", "largest distance that a body gets in the second half, in sizes of the smallest body",
             *_own("drift")),
        _relative("pressure", "mean force on all that stands still, after the first fifth; 1 is the right one",
                  signed=True),
        _relative("rate", "impacts per second, after the first fifth; 1 is the right rate", signed=True),
        _relative("kinetic", "kinetic energy in the end; 1 is the right one", signed=True),
    )
}  # fmt: skip

OF_KIND: Mapping[str, tuple[str, ...]] = {
    SMOOTH: ("position", "energy"),
    IMPACTS: ("position", "energy", "impact_time", "count"),
    RESTING: ("overlap", "overlap_mean", "speed", "drift"),
    CHAOTIC: ("pressure", "rate", "kinetic"),
}


def check_norm(name: str, of_game: Iterable[str] = ()) -> None:
    """Problem for a norm that neither carom nor the game has."""
    known = (*NORMS, *of_game)
    if name not in known:
        raise Problem(f"no norm {name!r}{did_you_mean(name, known)}")


@functools.cache
def norm_of(name: str) -> Norm:
    """The norm of that name; a name that is not in NORMS is that of something a game compares."""
    if name in NORMS:
        return NORMS[name]
    own = name.removeprefix(MEAN)

    def scale(seen: Seen, reference: Seen) -> float:
        right, mine = (np.array(one.values.get(own, [np.nan])) for one in (reference, seen))
        if len(right) > 1 or len(mine) > 1:
            return _reach(seen, reference)
        sizes = [abs(float(value[0])) for value in (right, mine) if np.isfinite(value).all()]
        return next(filter(None, sizes), 1.0)

    def measure(seen: Seen, reference: Seen) -> float:
        found = difference(seen, reference, own)
        if not np.isfinite(found):
            return float(np.sign(found)) if name != own else 1.0  # only one of the runs has it
        return (found if name != own else abs(found)) / scale(seen, reference)

    what = f"{own}, averaged over the seeds" if name != own else own
    return Norm(name, f"{what}, as the game counts it; 1 is the right value", measure, scale, signed=name != own)


def difference(seen: Seen, reference: Seen, name: str) -> float:
    """What a game compares against the right value: of numbers the difference, of places the distance; +-inf if only
    one of the runs has it."""
    mine, right = (np.array(one.values.get(name, [np.nan])) for one in (seen, reference))
    has, should = not np.isnan(mine).any(), not np.isnan(right).any()
    if has != should:
        return np.inf if has else -np.inf
    if not has:
        return 0.0
    return float(mine[0] - right[0]) if len(right) == 1 else float(np.linalg.norm(mine - right))


def failure_of(seen: Seen, reference: Seen | None) -> str | None:
    """The reason why the run has no error figure, or None.

    Tunnelled: a body that touches something in the reference has touched nothing.
    """
    if seen.failure:
        return seen.failure
    if not np.isfinite(seen.position).all():
        return NOT_FINITE
    if reference is None:
        return None
    if seen.reach > FAR * max(reference.reach, 1e-300):
        return BLEW_UP
    same = seen.fixed and reference.fixed and not reference.values  # a game tells itself what went wrong
    if same and any(should and not did for did, should in zip(seen.struck, reference.struck, strict=False)):
        return TUNNELLED
    return None


def errors_of(seen: Seen, reference: Seen, names: Iterable[str]) -> dict[str, float]:
    """Errors by name; those of statistics are signed."""
    return {name: norm_of(name).measure(seen, reference) for name in names}
