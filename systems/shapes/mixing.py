"""How the restitutions or frictions of two bodies become the contact's."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ...framework.compilation import inlined
from ...framework.plugins.registry import Registry
from ...framework.settings import MIXING_RULES

AVERAGE, GEOMETRIC_MEAN, MAX, MIN, MULTIPLY = range(len(MIXING_RULES))  # in their order
OWN = len(MIXING_RULES)  # the first of the plugins' rules


@inlined
def standard_mix(rule, a, b):
    """The contact's value from those of its two bodies."""
    if rule == MAX:
        return max(a, b)
    if rule == AVERAGE:
        return 0.5 * (a + b)
    if rule == GEOMETRIC_MEAN:
        return np.sqrt(a * b)
    if rule == MIN:
        return min(a, b)
    return a * b


@inlined
def mix_friction(mix, rule, a, b):
    """The contact's friction; who has none of his own (NaN) takes the partner's."""
    if a != a:
        a = b
    if b != b:
        b = a
    return mix(rule, a, b) if a == a else 0.0


@lru_cache(maxsize=64)
def mixing(rules: tuple[Any, ...]) -> Any:
    """mix(rule, a, b) with the rules of plugins, compiled functions of two numbers, behind the standard ones."""
    made = standard_mix
    for number, function in enumerate(rules, OWN):
        made = _with_rule(made, number, function)
    return made


def _with_rule(others: Any, number: int, function: Any) -> Any:
    @inlined
    def mix(rule, a, b):
        if rule != number:
            return others(rule, a, b)
        mixed = float(function(a, b))
        if not 0.0 <= mixed < np.inf:
            raise ValueError("a mixing rule of a plugin returned no number from 0")
        return mixed

    return mix


def rule_number(registry: Registry, name: str) -> int:
    """What kernels know the rule by; ValueError if neither carom nor a plugin of the world has it."""
    known = (*MIXING_RULES, *registry.mixing_rules)
    if name not in known:
        raise ValueError(f"mixing rules of this world are {', '.join(known)}, got {name!r}")
    return known.index(name)
