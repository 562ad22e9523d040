"""How the restitutions or frictions of two bodies become the contact's."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from ....framework.compilation import inlined, part
from ....framework.jit.linking import CACHE_SIZE, Linked
from ....framework.plugins.registry import Registry
from ....framework.settings import MIXING_RULES
from ....framework.vectors import negative, sub
from .signatures import call_material, call_mixing, linked_signature
from .user_functions import user_function

AVERAGE, GEOMETRIC_MEAN, MAX, MIN, MULTIPLY = range(len(MIXING_RULES))  # in their order
FIRST_PLUGIN_RULE = len(MIXING_RULES)


@inlined
def mix(state, rule, a, b):
    """The contact's value from those of its two bodies."""
    if rule == MAX:
        return max(a, b)
    if rule == AVERAGE:
        return 0.5 * (a + b)
    if rule == GEOMETRIC_MEAN:
        return np.sqrt(a * b)
    if rule == MIN:
        return min(a, b)
    if rule == MULTIPLY:
        return a * b
    return call_mixing(state.shapes.mixing[rule - FIRST_PLUGIN_RULE], a, b)


@inlined
def restitution_of(state, a, b):
    """The restitution of contacts of bodies a and b; the most of any, where it is not the same everywhere."""
    of, slot = state.colliders.restitution, state.bodies.collider_slot
    return mix(state, state.restitution_rule, of[slot[a], a], of[slot[b], b])


@inlined
def has_material(state, i):
    """Whether body i need not be the same everywhere."""
    return state.shapes.material[state.bodies.shape[i]] != 0


@inlined
def material_at(state, i, point, normal):
    """(friction, restitution, surface velocity) of body i, that :func:`has_material`, at a point from the centre of its
    shape, the normal leading away; nan: as its collider's."""
    shapes, shape = state.shapes, state.bodies.shape[i]
    return call_material(shapes.material[shape], shapes.parameters[shape], i, point, normal)


@part
def touched_restitution(state, i, own, point, normal):
    """The restitution of body i there, at most its own."""
    there = material_at(state, i, point, normal)[1]
    return there if there < own else own


@part
def touched_friction(state, i, own, point, normal):
    """Its friction there."""
    there = material_at(state, i, point, normal)[0]
    return there if there == there else own


@inlined
def restitution_at(state, a, b, touch):
    """The restitution of a contact of bodies a and b.

    touch: (point from the centre of a's shape, normal from a to b, from that centre to that of b's shape)
    """
    of, slot, (point, normal, apart) = state.colliders.restitution, state.bodies.collider_slot, touch
    one, other = of[slot[a], a], of[slot[b], b]
    if has_material(state, a):
        one = touched_restitution(state, a, one, point, normal)
    if has_material(state, b):
        other = touched_restitution(state, b, other, sub(point, apart), negative(normal))
    return mix(state, state.restitution_rule, one, other)


@inlined
def friction_at(state, a, b, touch):
    """Its friction. NaN: use the other body's coefficient; 0 if neither has one."""
    of, slot, (point, normal, apart) = state.colliders.friction, state.bodies.collider_slot, touch
    one, other = of[slot[a], a], of[slot[b], b]
    if has_material(state, a):
        one = touched_friction(state, a, one, point, normal)
    if has_material(state, b):
        other = touched_friction(state, b, other, sub(point, apart), negative(normal))
    if one != one:
        one = other
    if other != other:
        other = one
    return mix(state, state.friction_rule, one, other) if one == one else 0.0


@lru_cache(maxsize=CACHE_SIZE)
def linked_rule(function: Any) -> Linked:
    """A plugin's rule, its answers checked."""
    rule = user_function(function)

    def mixed(a, b):
        value = float(rule(a, b))
        if not 0.0 <= value < math.inf:
            raise ValueError("a mixing rule of a plugin returned no number from 0")
        return value

    return Linked(mixed, linked_signature("mixed", 2), f"mixing rule {getattr(function, '__name__', mixed.__name__)}")


def rule_number(registry: Registry, name: str) -> int:
    """What kernels know the rule by; ValueError if neither carom nor a plugin of the world has it."""
    known = (*MIXING_RULES, *registry.mixing_rules)
    if name not in known:
        raise ValueError(f"mixing rules of this world are {', '.join(known)}, got {name!r}")
    return known.index(name)
