"""Effects of settings on a run that a player could notice, in metres and seconds, and whether they would be.

``place`` m, how far a body ends from where it should, and ``body``, which one; ``apex`` m, how much higher the highest
point is; ``contact`` s, how much later the first impact; ``impacts``, how many more there are; ``sink`` m, the deepest
overlap of what rests; ``jitter`` m/s, the fastest body at rest; ``energy``, the share gained in a minute where energy
is kept; ``size`` m, the smallest extent of the bodies.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..trading.records import CHAOTIC, RESTING
from .norms import conserves, energy_scale
from .observation import Seen

SHARE = 0.01  # of a body's size, or of the energy in a minute: less is not noticed
SPEED = 0.02  # sizes per second
LATE = 0.01  # s


def effects_of(seen: Seen, reference: Seen, kind: str) -> dict[str, float]:
    """The effects in one run that did not fail."""
    found = {"size": seen.size}
    if kind != CHAOTIC and len(seen.position) == len(reference.position):
        apart = np.sqrt(((seen.position - reference.position) ** 2).sum(axis=1))
        worst = int(np.argmax(apart))
        found["place"] = float(apart[worst])
        if seen.entities:
            found["body"] = float(seen.entities[worst])
        if reference.apex > 0:
            found["apex"] = seen.apex - reference.apex
        if seen.times and reference.times:
            found["contact"] = seen.times[0] - reference.times[0]
            found["impacts"] = float(seen.impacts - reference.impacts)
    if seen.overlap:
        found["sink"] = seen.overlap * seen.size
    if kind == RESTING:
        found["jitter"] = seen.speed * seen.size
    if conserves(reference):
        found["energy"] = (seen.energy - seen.energy_start) / energy_scale(seen, reference) * 60 / seen.seconds
    return found


def noticed(effects: Mapping[str, float]) -> dict[str, float]:
    """Those that would be noticed."""
    return {name: effects[name] for name, times in _times_the_limit(effects).items() if times > 1}


def severity(effects: Mapping[str, float]) -> float:
    """The worst effect over its limit: nothing is noticed up to 1."""
    return max(_times_the_limit(effects).values(), default=0.0)


def _times_the_limit(effects: Mapping[str, float]) -> dict[str, float]:
    size = effects.get("size", 1.0)
    limits = {
        "place": SHARE * size, "apex": SHARE * size, "contact": LATE, "impacts": 0.5, "sink": SHARE * size,
        "jitter": SPEED * size, "energy": SHARE,
    }  # fmt: skip
    return {name: abs(effects[name]) / limit for name, limit in limits.items() if name in effects}


def in_words(effects: Mapping[str, float], names: Any = None) -> list[str]:
    """A phrase for each of these effects (default: those that would be noticed)."""
    shown = noticed(effects) if names is None else {name: effects[name] for name in names if name in effects}
    return [_phrase(name, value, effects) for name, value in shown.items()]


def _phrase(name: str, value: float, effects: Mapping[str, float]) -> str:
    if name == "place":
        body = f"entity {effects['body']:.0f}" if "body" in effects else "a body"
        return f"{body} ends {metres(value)} from where it should"
    if name == "apex":
        return f"the highest point is {metres(value)} {'higher' if value > 0 else 'lower'}"
    if name == "contact":
        return f"the first contact is {1e3 * abs(value):.3g} ms {'late' if value > 0 else 'early'}"
    if name == "impacts":
        return f"{abs(value):.0f} impacts {'more' if value > 0 else 'fewer'}"
    if name == "sink":
        return f"bodies sink {metres(value)} into each other"
    if name == "jitter":
        return f"what rests still moves at {metres(value)} per second"
    return f"the energy {'grows' if value > 0 else 'falls'} by {100 * abs(value):.2g} % a minute"


def metres(value: float) -> str:
    """A length: 4.2 mm, 12 cm, 3.4 m; the unit is that of the scene."""
    size = abs(value)
    if size < 1e-6:
        return "less than 0.001 mm"
    if size < 0.01:
        return f"{1e3 * size:.2g} mm"
    return f"{100 * size:.2g} cm" if size < 1 else f"{size:.3g} m"
