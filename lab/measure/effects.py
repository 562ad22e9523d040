"""Effects of settings on a run that a player could notice, in metres and seconds, and whether they would be.

``place`` m, how far a body ends from where it should, and ``body``, which one; ``apex`` m, how much higher the highest
point is; ``contact`` s, how much later the first impact; ``impacts``, how many more there are; ``sink`` m, the deepest
overlap of what rests; ``jitter`` m/s, the fastest body at rest; ``energy``, the share gained in a minute where energy
is kept; ``touches``, how many pairs touch in another order than they should, in one of the runs only or not at all;
``size`` m, the smallest extent of the bodies; ``doubt`` m, how far the references differ: less is not noticed.

Of what a game compares, by ``(what, name)`` in one word: ``value``, the difference; ``right``; ``limit``, from which on
it is noticed; of a game that is chaotic ``mean``, the difference of the means over ``runs`` seeds, with ``spread`` from
seed to seed and ``known``, over how many the right value is a mean.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..reporting.text import metres
from ..trading.records import CHAOTIC, RESTING
from .norms import conserves, difference, distances, energy_scale, other_touches
from .observation import Seen

SHARE = 0.01  # of a body's size, or of the energy in a minute: less is not noticed
SPEED = 0.02  # sizes per second
LATE = 0.01  # s
OF_SPREAD = 0.5  # of the spread from game to game
CHANCE = (12.7, 4.3, 3.2, 2.8, 2.6, 2.4, 2.4, 2.3, 2.3, 2.2)  # standard errors, 5 %, from 1 degree of freedom on
OF_MANY = 2.0  # standard errors, from many
FEW = 2  # games tell little of their spread
NEVER = 1e9  # in the place of infinity: only one of the runs has the value
HOW = ("never", "touches", "order")
HOW_IN_WORDS = ("never touches {}", "touches {}, which it should not", "touches {} out of turn")
BESIDES = ("body", "runs", "one", "other", "how")  # tell more about another effect
PLACE, MOST_PLACES = "value at ", 2
OF_GAME = ("value", "mean")


def effects_of(seen: Seen, reference: Seen, kind: str) -> dict[str, float]:
    """The effects in one run that did not fail."""
    found = {"size": seen.size, **_of_game(seen, reference, kind)}
    if not seen.fixed:  # what it compares is all there is to tell
        return found
    apart, ids = distances(seen, reference)
    named = any(word.startswith(PLACE) for word in found)
    if kind != CHAOTIC and len(apart) and not named:
        worst = int(np.argmax(apart))
        found["place"] = float(apart[worst])
        if len(ids):
            found["body"] = float(ids[worst])
        found |= {"doubt": reference.doubt} if reference.doubt else {}
    if "place" in found and reference.doubt <= SHARE * seen.size:
        if reference.apex > 0:
            found["apex"] = seen.apex - reference.apex
        if seen.times and reference.times:
            found["contact"] = seen.times[0] - reference.times[0]
            found["impacts"] = float(seen.impacts - reference.impacts)
        if kind != RESTING and seen.touches and reference.touches and (others := other_touches(seen, reference)):
            found["touches"] = float(len(others))
            found["one"], found["other"] = map(float, others[0][:2])
            found["how"] = float(HOW.index(others[0][2]))
    if seen.overlap:
        found["sink"] = seen.overlap * seen.size
    if kind == RESTING:
        found["jitter"] = seen.speed * seen.size
    if conserves(reference):
        found["energy"] = (seen.energy - seen.energy_start) / energy_scale(seen, reference) * 60 / seen.seconds
    return found


def _of_game(seen: Seen, reference: Seen, kind: str) -> dict[str, float]:
    found: dict[str, float] = {}
    for name, right in reference.values.items():
        if kind == CHAOTIC and len(right) > 1:
            continue  # a place is another one in each game
        apart = difference(seen, reference, name)
        apart = apart if math.isfinite(apart) else math.copysign(NEVER, apart)
        least = 0.5 if len(right) == 1 and right[0] % 1 == 0 else 0.0
        limit = SHARE * (seen.size if len(right) > 1 else abs(right[0]))
        found[f"limit {name}"] = NEVER / 2 if math.isnan(limit) else max(limit, least)
        found[f"right {name}"] = right[0] if len(right) == 1 and not math.isnan(right[0]) else NEVER
        if kind == CHAOTIC:
            found |= {f"mean {name}": apart, f"spread {name}": reference.spread.get(name, 0.0)}
            found["known"] = float(reference.runs)
        else:
            found[f"value {name}" if len(right) == 1 else f"value at {name}"] = apart
            if len(right) > 1:
                found[f"limit at {name}"] = found.pop(f"limit {name}")
    return found


def at_worst(all_effects: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The effects of a setting from those of its runs: each at its worst; energies and means of games, which have a
    sign and no worst, as their mean."""
    found: dict[str, float] = {}
    for effects in all_effects:
        for name, value in effects.items():
            if name not in BESIDES and abs(value) >= abs(found.get(name, 0.0)):
                found[name] = value
                for other in ("body",) if name == "place" else ("one", "other", "how") if name == "touches" else ():
                    if other in effects:
                        found[other] = effects[other]
    for name in found:
        if name == "energy" or name.startswith("mean "):
            found[name] = statistics.fmean(values := [effects.get(name, 0.0) for effects in all_effects])
            spread = name.replace("mean ", "spread ", 1)
            if spread in found and len(values) > 1 and max(map(abs, values)) < NEVER:
                found[spread] = max(found[spread], statistics.stdev(values))
    return {**found, "runs": float(len(all_effects))} if found else found


def noticed(effects: Mapping[str, float], way: float | None = None) -> dict[str, float]:
    """Those that would be noticed; way: how far a body may be elsewhere, m (default: a share of its size)."""
    return {name: effects[name] for name, times in _times_the_limit(effects, way).items() if times > 1}


def severity(effects: Mapping[str, float]) -> float:
    """The worst effect over its limit: nothing is noticed up to 1."""
    return max(_times_the_limit(effects).values(), default=0.0)


def _times_the_limit(effects: Mapping[str, float], way: float | None = None) -> dict[str, float]:
    size = effects.get("size", 1.0)
    way = SHARE * size if way is None else way
    place = max(way, effects.get("doubt", 0.0))
    limits = {
        "place": place, "apex": way, "contact": LATE, "impacts": 0.5, "sink": way, "jitter": SPEED * size,
        "energy": SHARE, "touches": 0.5,
    }  # fmt: skip
    for word in effects:
        what, _, name = word.partition(" ")
        if what in OF_GAME and name:
            limits[word] = limit_of(name, effects)
    return {name: abs(effects[name]) / (limit or SHARE) for name, limit in limits.items() if name in effects}


def limit_of(name: str, effects: Mapping[str, float]) -> float:
    """The least difference that would be noticed; of means it must be more than chance, and large beside what one game
    differs from the next."""
    spread, runs, known = effects.get(f"spread {name}", 0.0), effects.get("runs", 1.0), effects.get("known", 1.0)
    if known <= FEW and f"spread {name}" in effects:
        spread = max(spread, effects[f"limit {name}"])
    freedom = int(known) - 1
    chance = CHANCE[freedom - 1] if 0 < freedom <= len(CHANCE) else OF_MANY
    return max(effects[f"limit {name}"], spread * max(OF_SPREAD, chance * math.sqrt(1 / runs + 1 / known)))


def in_words(effects: Mapping[str, float], names: Any = None) -> list[str]:
    """A phrase for each of these effects (default: those that would be noticed)."""
    shown = noticed(effects) if names is None else {name: effects[name] for name in names if name in effects}
    return _phrases(shown, effects)


def names_told(effects: Mapping[str, float]) -> tuple[str, ...]:
    """The names of what the game compares."""
    found = (word.partition(" ")[2] for word in effects if word.partition(" ")[0] in OF_GAME)
    return tuple(name.removeprefix("at ") for name in found)


def told(effects: Mapping[str, float]) -> list[str]:
    """A phrase for each value that the game compares, noticed or not."""
    return _phrases({word: effects[word] for word in effects if word.partition(" ")[0] in OF_GAME}, effects)


def _phrases(shown: Mapping[str, float], effects: Mapping[str, float]) -> list[str]:
    """A phrase for each; of the places that a game names for the MOST_PLACES worst."""
    places = sorted((word for word in shown if word.startswith(PLACE)), key=lambda word: -shown[word])
    left = set(places[MOST_PLACES:])
    words = [_phrase(name, value, effects) for name, value in shown.items() if name not in left]
    return [*words, f"{len(left)} more end less far from where they should"] if left else words


def _phrase(name: str, value: float, effects: Mapping[str, float]) -> str:
    what, _, own = name.partition(" ")
    if what in OF_GAME and own:
        return _of_game_in_words(what, own, value, effects)
    if name == "touches":
        one, other = (f"entity {effects[end]:.0f}" for end in ("one", "other"))
        more = f" ({value:.0f} such pairs)" if value > 1 else ""
        return f"{one} {HOW_IN_WORDS[int(effects['how'])].format(other)}{more}"
    if name == "place":
        body = f"entity {effects['body']:.0f}" if "body" in effects else "a body"
        return f"{body} ends {metres(value)} from where it should"
    more = value > 0
    words = {
        "apex": f"the highest point is {metres(value)} {'higher' if more else 'lower'}",
        "contact": f"the first contact is {1e3 * abs(value):.3g} ms {'late' if more else 'early'}",
        "impacts": f"{abs(value):.0f} impacts {'more' if more else 'fewer'}",
        "sink": f"bodies sink {metres(value)} into each other",
        "jitter": f"what rests still moves at {metres(value)} per second",
    }
    return words.get(name, f"the energy {'grows' if more else 'falls'} by {100 * abs(value):.2g} % a minute")


def _of_game_in_words(what: str, name: str, value: float, effects: Mapping[str, float]) -> str:
    if name.startswith("at ") and f"right {name}" not in effects:
        if abs(value) == NEVER:
            return f"{name.removeprefix('at ')}: none, and there should be one"
        return f"{name.removeprefix('at ')} ends {metres(value)} from where it should"
    right = effects[f"right {name}"]
    if abs(value) == NEVER:
        return f"{name}: {'there is one, and there should be none' if value > 0 else f'none instead of {right:.4g}'}"
    if what == "mean":
        spread = effects.get(f"spread {name}", 0.0)
        mean = f"{name}: {right + value:.4g} on average instead of {right:.4g}"
        return f"{mean}; one game differs from the next by {spread:.2g}" if spread else mean
    if right == NEVER:
        return f"{name}: none, as it should be"
    return f"{name}: {right + value:.4g} instead of {right:.4g}" if value else f"{name}: {right:.4g}, as it should be"
