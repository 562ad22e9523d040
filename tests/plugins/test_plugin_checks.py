"""Defects of a plugin are reported at registration, with name, function and cure; nothing is changed."""

from __future__ import annotations

import math

import pytest

from carom.components import RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider
from carom.framework import Component, Convex, Plugin, PluginError, StepError, World, column
from carom.framework.vectors import divided, length, scale
from carom.plugins import Physics

pytestmark = pytest.mark.plain


def disc_class(**members):
    """A round shape; members replace its attributes, None removes one."""

    def bounds(shape, dimensions):
        return (shape.reach, shape.reach) if dimensions == 2 else (shape.reach, shape.reach, shape.reach)

    body = {"reach": column(positive=True), "bounds": bounds, **members}
    return type("DiscCollider", (Collider,), {name: value for name, value in body.items() if value is not None})


@Plugin("helpers").kernel
def first_axis(d):
    if len(d) == 2:
        return 1.0, 0.0
    return 1.0, 0.0, 0.0


def disc_disc(a, b, d):
    depth = a.reach + b.reach - length(d)
    normal = divided(d, length(d)) if length(d) > 0.0 else first_axis(d)
    return depth >= 0.0, depth, normal, scale(d, 0.5)


def registered(**members):
    plugin = Plugin("discs")
    disc = plugin.shape(cost=2)(disc_class(**members))
    return plugin, disc


SHAPES = {
    "is no class": (lambda: 7, "a shape is a class derived from Collider, got 7"),
    "is no collider": (
        lambda: type("Charge", (Component,), {"value": column(0.0)}),
        "Charge must derive from carom.components.Collider",
    ),
    "has no bounds": (lambda: disc_class(bounds=None), r"has no bounds: write bounds\(shape, dimensions\)"),
    "bounds take too few": (
        lambda: disc_class(bounds=lambda shape: (1.0, 1.0)),
        r"bounds takes \(shape\), it must take 2 arguments: \(shape, dimensions\)",
    ),
    "bounds are a number": (
        lambda: disc_class(bounds=lambda shape, dimensions: shape.reach), "a tuple of 2 numbers"
    ),
    "bounds of 2D only": (
        lambda: disc_class(bounds=lambda shape, dimensions: (shape.reach, shape.reach)), "a tuple of 3 numbers"
    ),
    "bounds are NaN": (
        lambda: disc_class(bounds=lambda shape, dimensions: (math.nan,) * dimensions), "not negative"
    ),
    "bounds raise": (
        lambda: disc_class(bounds=lambda shape, dimensions: [][1]), "it raised IndexError: list index out of range"
    ),
    "bounds ask for a field that is not there": (
        lambda: disc_class(bounds=lambda shape, dimensions: (shape.radius,) * dimensions),
        r"no attribute 'radius' \(it has reach\)",
    ),
    "support is no point": (lambda: disc_class(support=lambda shape, direction: 1.0), "return a point"),
    "support is NaN": (
        lambda: disc_class(support=lambda shape, direction: (math.nan,) * len(direction)), "must be finite"
    ),
    "rounding is negative": (
        lambda: disc_class(support=lambda shape, direction: scale(direction, 0.0), rounding=lambda shape: -1.0),
        "return a number from 0",
    ),
    "dimensions are strange": (lambda: disc_class(dimensions=(4,)), r"dimensions must be \(2,\), \(3,\) or \(2, 3\)"),
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_that_cannot_be_one(name):
    make, message = SHAPES[name]
    plugin = Plugin("discs")
    with pytest.raises(PluginError, match=rf"^plugin discs: shape.*{message}"):
        plugin.shape(cost=2)(make())
    assert not plugin.shapes


@pytest.mark.parametrize("cost", [0, -1, math.nan, "2", True])
def test_the_cost_is_a_number_above_zero(cost):
    with pytest.raises(PluginError, match="plugin discs: shape DiscCollider: cost must be a number above 0"):
        Plugin("discs").shape(cost=cost)(disc_class())


def ones(d):
    return tuple(1.0 for _ in d)


PAIRS = {
    "takes too few": (lambda a, b: None, r"takes \(a, b\), it must take 3 arguments: \(a, b, d\)"),
    "takes any number": (lambda *all: None, r"takes \(\*all\), it must take 3 arguments"),
    "returns a number": (lambda a, b, d: 1.0, r"return \(hit, depth, normal, point\)"),
    "returns three": (lambda a, b, d: (True, 1.0, d), r"return \(hit, depth, normal, point\)"),
    "hit is a number": (lambda a, b, d: (1, 1.0, ones(d), d), "hit, the first value, must be True or False"),
    "depth is a vector": (lambda a, b, d: (True, d, ones(d), d), "depth, the second value, must be a number"),
    "normal is a number": (lambda a, b, d: (True, 1.0, 1.0, d), "normal must be a tuple of 2 numbers"),
    "normal is not unit": (lambda a, b, d: (True, 1.0, ones(d), d), "length is 1.41421, it must be 1: divide it"),
    "point is a number": (
        lambda a, b, d: (True, 1.0, divided(ones(d), length(ones(d))), 0.0), "point must be a tuple of 2 numbers"
    ),
    "depth is NaN": (
        lambda a, b, d: (True, math.nan, divided(ones(d), length(ones(d))), d), "every value must be finite"
    ),
    "not finite for one centre": (
        lambda a, b, d: (a.reach + b.reach >= length(d), a.reach + b.reach - length(d), divided(d, length(d)), d),
        "the centres coincide: choose any normal then",
    ),
    "divides by zero": (
        lambda a, b, d: (True, 1.0 / (math.hypot(*d) - 0.5 + 0.5), d, d) if not any(d) else disc_disc(a, b, d),
        "divides by zero",
    ),
    "raises": (lambda a, b, d: [][1], "it raised IndexError"),
    "asks for what is not there": (lambda a, b, d: a.radius, r"no attribute 'radius' \(it has reach\)"),
    "the depth has the wrong sign": (
        lambda a, b, d: (disc_disc(a, b, d)[0], -disc_disc(a, b, d)[1], *disc_disc(a, b, d)[2:]),
        "hit must be depth >= 0",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PAIRS)
def test_a_pair_that_cannot_be_one(name):
    function, message = PAIRS[name]
    plugin, disc = registered()
    with pytest.raises(PluginError, match=rf"^plugin discs: pair <lambda> of DiscCollider and DiscCollider.*{message}"):
        plugin.pair(disc, disc)(function)
    assert not plugin.pairs


def test_a_pair_is_of_collider_classes():
    plugin, disc = registered()
    with pytest.raises(PluginError, match="a pair is of two collider classes, or one and Convex, got 'sphere'"):
        plugin.pair(disc, "sphere")(disc_disc)
    with pytest.raises(PluginError, match="register a plain function"):
        plugin.pair(disc, disc)(math.hypot)
    with pytest.raises(PluginError, match=r"it must take 5 arguments: \(a, b, d, support, rounding\)"):
        plugin.pair(disc, Convex)(disc_disc)


def test_a_pair_is_registered_in_one_order():
    plugin, disc = registered()
    plugin.pair(disc, SphereCollider)(lambda a, b, d: disc_disc(a, type(a)(b.radius), d))
    with pytest.raises(PluginError, match="SphereCollider and DiscCollider is registered already, in the other order"):
        plugin.pair(SphereCollider, disc)(lambda a, b, d: disc_disc(type(b)(a.radius), b, d))


def test_the_other_things_are_looked_at_too():
    plugin = Plugin("things")
    with pytest.raises(PluginError, match=r"integrator 'jump': register a class .*int has no advance, order, eval"):
        plugin.integrator("jump")(int)
    with pytest.raises(PluginError, match=r"broad phase 'all': register a class with pairs\(lower, upper, moving\)"):
        plugin.broad_phase("all")(int)
    with pytest.raises(PluginError, match=r"mixing rule 'first': for 0.25 and 1.0 it returned 0.25, for 1.0 and 0.25"):
        plugin.mixing_rule("first")(lambda x, y: x)
    with pytest.raises(PluginError, match=r"mixing rule 'minus': .* return a number from 0"):
        plugin.mixing_rule("minus")(lambda x, y: -1.0)
    with pytest.raises(PluginError, match=r"pair filter <lambda> takes \(\), it must take 3 arguments"):
        plugin.pair_filter(lambda: None)
    with pytest.raises(PluginError, match="system takes a class"):
        plugin.system(3)
    with pytest.raises(PluginError, match="kernel takes a function"):
        plugin.kernel(3)
    with pytest.raises(PluginError, match="register the pair itself first"):
        plugin.sweep(SphereCollider, SphereCollider)(lambda a, b, d, v: (False, 1.0))
    with pytest.raises(ValueError, match="a plugin needs a name"):
        Plugin("")


def test_names_are_taken_once():
    plugin, disc = registered()
    other = Plugin("others")
    other.shape(cost=3)(disc)
    with pytest.raises(PluginError, match="plugin others: shape DiscCollider is registered already, by plugin discs"):
        World(Physics(), plugin, other)
    world = World(Physics(), plugin)
    with pytest.raises(PluginError, match="a plugin named 'discs' is in this world already"):
        world.add_plugin(Plugin("discs"))
    again = Plugin("spheres")
    again.pair(SphereCollider, SphereCollider)(lambda a, b, d: disc_disc(disc_like(a.radius), disc_like(b.radius), d))
    with pytest.raises(PluginError, match="plugin spheres: the pair of SphereCollider and SphereCollider is reg"):
        world.add_plugin(again)
    with pytest.raises(TypeError, match="add_plugin takes a plugin, got 3"):
        world.add_plugin(3)
    world.create_entity(Transform((0, 0)), RigidBody(), disc(1.0))
    plugin.pair(disc, disc)(disc_disc)
    world.step()
    assert world.step_count == 1
    world.close()


class disc_like:  # noqa: N801
    def __init__(self, reach):
        self.reach = reach


def test_a_late_registration_that_clashes_changes_nothing():
    """The world that has both plugins is unchanged, and the registration that conflicts is refused with the reason."""
    plugin, disc = registered()
    plugin.pair(disc, disc)(disc_disc)
    other = Plugin("others")
    world = World(Physics(), plugin, other)
    with pytest.raises(PluginError, match="plugin others: the pair of DiscCollider and DiscCollider is registered"):
        other.pair(disc, disc)(disc_disc)
    assert not other.pairs
    world.create_entity(Transform((0, 0)), RigidBody(), disc(1.0))
    world.create_entity(Transform((1.5, 0)), RigidBody(), disc(1.0))
    world.step()
    assert len(world.contacts) == 1
    world.close()


@pytest.mark.compiled
def test_what_cannot_be_compiled_is_named():
    """Python can do more than compiled code; errors found only by the compiler name plugin, shape and function too."""
    plugin, disc = registered(bounds=lambda shape, dimensions: (shape.reach,) * dimensions)
    plugin.pair(disc, disc)(disc_disc)
    world = World(Physics(), plugin)
    world.create_entity(Transform((0, 0)), RigidBody(), disc(1.0))
    failed = "opening the step failed in step 0"
    message = f"^{failed} .*plugin discs: shape DiscCollider: bounds cannot be compiled; use"
    with pytest.raises(StepError, match=message):
        world.step()
    assert world.step_count == 0
    world.close()


def test_apart_the_depth_is_minus_the_gap():
    plugin, disc = registered()
    with pytest.raises(PluginError, match="apart, its depth is minus infinity; return minus the gap"):
        plugin.pair(disc, disc)(
            lambda a, b, d: (
                disc_disc(a, b, d) if disc_disc(a, b, d)[0] else (False, -math.inf, *disc_disc(a, b, d)[2:])
            )
        )


SWEEPS = {
    "one value": (lambda a, b, d, v: (True,), r"return \(hit, time\)"),
    "NaN": (lambda a, b, d, v: (True, math.nan), "from 0 to 1"),
    "before the start": (lambda a, b, d, v: (True, -5.0), "from 0 to 1"),
    "raises": (lambda a, b, d, v: [][1], "it raised IndexError"),
}


@pytest.mark.parametrize("name", SWEEPS)
def test_a_sweep_that_cannot_be_one(name):
    function, message = SWEEPS[name]
    plugin, disc = registered()
    plugin.pair(disc, disc)(disc_disc)
    with pytest.raises(PluginError, match=f"plugin discs: sweep <lambda> of DiscCollider and DiscCollider.*{message}"):
        plugin.sweep(disc, disc)(function)


@pytest.mark.parametrize(
    ("corner", "message"),
    [(3, "takes a function"), (lambda a: True, "it must take 4 arguments"), (lambda a, b, d, slop: 1, "True or False")],
)
def test_a_corner_that_cannot_be_one(corner, message):
    plugin, disc = registered()
    with pytest.raises(PluginError, match=f"plugin discs: corner .* of DiscCollider and DiscCollider.*{message}"):
        plugin.pair(disc, disc, corner=corner)(disc_disc)


def test_a_pair_registered_again_has_no_sweep_of_the_former():
    plugin, disc = registered()
    plugin.pair(disc, disc)(disc_disc)
    plugin.sweep(disc, disc)(lambda a, b, d, v: (False, 1.0))
    plugin.pair(disc, disc)(disc_disc)
    assert plugin.pairs[disc, disc].sweep is None


def test_two_classes_of_one_name():
    plugin, _ = registered()
    other = Plugin("others")
    other.shape(cost=2)(disc_class(extra=column(1.0)))
    with pytest.raises(PluginError, match="plugin others: shape DiscCollider goes by the name of another class"):
        World(Physics(), plugin, other)


def test_names_of_caroms_own():
    plugin = Plugin("rules")
    plugin.mixing_rule("max")(lambda x, y: 0.0)
    with pytest.raises(PluginError, match="plugin rules: mixing rule max is one of carom's own names"):
        World(Physics(), plugin)


@pytest.mark.parametrize(("part", "value"), [("order", "a"), ("evaluations", -1), ("path", "zigzag")])
def test_what_an_integrator_says_of_itself(part, value):
    members = {"advance": lambda self, motion, dt: None, "order": 1, "evaluations": 1, "path": 1, part: value}
    with pytest.raises(PluginError, match=f"plugin steps: integrator 'still': {part} must be a whole number"):
        Plugin("steps").integrator("still")(type("Still", (), members))
