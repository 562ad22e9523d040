"""Names that users write: what was probably meant by one that does not exist."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping


def snake_case(name: str) -> str:
    """The name of a class as columns have it: ``aabb_collider`` of AABBCollider."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()


def near_names(
    wrong: str, known: Iterable[str], also: Mapping[str, str] | None = None, count: int = 1, cutoff: float = 0.6
) -> list[str]:
    """The known names that ``wrong`` probably stands for, the nearest first; [] if there is none.

    also
        other words for some of the known names
    """
    import difflib  # only here: it takes a while to load, and is needed only where something is wrong

    also = also or {}
    by_lower_case = {name.lower(): name for name in (*also, *known)}
    near = [by_lower_case[name] for name in difflib.get_close_matches(wrong.lower(), by_lower_case, count, cutoff)]
    return list(dict.fromkeys(also.get(name, name) for name in near))


def did_you_mean(wrong: str, known: Iterable[str], also: Mapping[str, str] | None = None) -> str:
    """`` (did you mean 'gravity'?)`` for a near miss, else nothing; goes behind the wrong name."""
    near = near_names(wrong, known, also)
    return f" (did you mean {near[0]!r}?)" if near else ""
