"""What cannot work, or breaks a law in one of a few poses, is refused where it is registered; nothing is changed."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider
from carom.framework import Component, Convex, Plugin, PluginError, StepError, World, column
from carom.framework.outlines import FACES, SIGNS
from carom.framework.vectors import divided, dot, length, negative, scale
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
    return depth >= 0.0, depth, normal, scale(normal, a.reach - 0.5 * depth)


def registered(plugin=None, **members):
    plugin = plugin or Plugin("discs")
    disc = plugin.shape(cost=2)(disc_class(**members))
    return plugin, disc


ROUND = {"support": lambda shape, direction: scale(direction, 0.0), "rounding": lambda shape: shape.reach}


def shape(**members):
    return lambda plugin: registered(plugin, **members)


QUAD = SIGNS[2] / 2


def outline(function, dimensions=(2,)):
    """Of a cube with half extents 0.5."""

    def bounds(shape, dimensions):
        return (0.5,) * dimensions

    def support(shape, direction):
        return tuple(math.copysign(0.5, x) for x in direction)

    return shape(bounds=bounds, support=support, outline=function, dimensions=dimensions)


LEVEL = SimpleNamespace(half_extents=(0.5, 0.5))


def edged(function):
    """A square with half extents 0.5 and this edge."""

    def support(shape, direction):
        return tuple(math.copysign(0.5, x) for x in direction)

    return shape(bounds=lambda shape, dimensions: (0.5, 0.5), support=support, edge=function, dimensions=(2,))


def pair(function, **members):
    def register(plugin):
        disc = registered(plugin, **members)[1]
        plugin.pair(disc, disc)(function)

    return register


def part(change, **members):
    """A pair whose contacts are disc_disc's, changed: (hit, depth, normal, point) -> the same."""
    return pair(lambda a, b, d: change(*disc_disc(a, b, d)), **members)


def round_part(change):
    return part(change, **ROUND)


def sweep(function):
    def register(plugin):
        disc = registered(plugin)[1]
        plugin.pair(disc, disc)(disc_disc)
        plugin.sweep(disc, disc)(function)

    return register


def corner(function):
    def register(plugin):
        disc = registered(plugin)[1]
        plugin.pair(disc, disc, corner=function)(disc_disc)

    return register


def integrator(part, value):
    members = {"advance": lambda self, motion, dt: None, "order": 1, "evaluations": 1, "path": 1, part: value}
    return lambda plugin: plugin.integrator("still")(type("Still", (), members))


def ones(d):
    return tuple(1.0 for _ in d)


def first_touch(a, b, d, v):
    """The sweep of two discs."""
    p, q, r = dot(v, v), dot(d, v), dot(d, d) - (a.reach + b.reach) ** 2
    root = q * q - p * r
    if r <= 0.0 or root < 0.0 or q >= 0.0:
        return r <= 0.0, 0.0
    return r / (math.sqrt(root) - q) <= 1.0, r / (math.sqrt(root) - q)



# What an author may get wrong, and what the message says of it.
MISTAKES = {
    # -- shapes
    "no class": (lambda plugin: plugin.shape(cost=2)(7), "a shape is a class derived from Collider, got 7"),
    "no collider": (
        lambda plugin: plugin.shape(cost=2)(type("Charge", (Component,), {"value": column(0.0)})),
        "Charge must derive from carom.components.Collider",
    ),
    **{
        f"cost {cost!r}": (
            lambda plugin, cost=cost: plugin.shape(cost=cost)(disc_class()), "cost must be a number above 0"
        )
        for cost in (0, -1, math.nan, "2", True)
    },
    "no bounds": (shape(bounds=None), r"has no bounds: write bounds\(shape, dimensions\)"),
    "bounds of one argument": (
        shape(bounds=lambda shape: (1.0, 1.0)),
        r"bounds takes \(shape\), it must take 2 arguments: \(shape, dimensions\)",
    ),
    "bounds are a number": (shape(bounds=lambda shape, dimensions: shape.reach), "a tuple of 2 numbers"),
    "bounds of 2D only": (shape(bounds=lambda shape, dimensions: (shape.reach,) * 2), "a tuple of 3 numbers"),
    "bounds are NaN": (shape(bounds=lambda shape, dimensions: (math.nan,) * dimensions), "not negative"),
    "bounds raise": (shape(bounds=lambda shape, dimensions: [][1]), "it raised IndexError: list index out of range"),
    "bounds ask for a field that is not there": (
        shape(bounds=lambda shape, dimensions: (shape.radius,) * dimensions),
        r"no attribute 'radius' \(it has reach\)",
    ),
    "bounds too small": (
        shape(**ROUND, bounds=lambda shape, dimensions: (0.4,) * dimensions), "make bounds enclose the whole shape"
    ),
    "support is no point": (shape(support=lambda shape, direction: 1.0), "return a point"),
    "support is NaN": (shape(support=lambda shape, direction: (math.nan,) * len(direction)), "must be finite"),
    "support is not the farthest point": (
        shape(support=lambda shape, direction: scale(direction, -0.1)), "whose product with the direction is largest"
    ),
    "support of unit vectors": (
        shape(support=lambda shape, direction: scale(direction, 0.1)), "for a direction of another length"
    ),
    "rounding is negative": (shape(**ROUND | {"rounding": lambda shape: -1.0}), "return a number from 0"),
    "rounding is a vector": (shape(**ROUND | {"rounding": lambda shape: (1.0, 1.0)}), "its core: a number"),
    "moments too few": (shape(second_moments=lambda shape, dimensions: (1.0, 0.0)), "measure, centre, means of xx"),
    "moments negative": (
        shape(second_moments=lambda shape, dimensions: (1.0, 0.0, 0.0, -1.0, 0.0, 1.0)), "squares not negative"
    ),
    "outline is corners alone": (outline(lambda shape, dimensions: [(0.0, 0.0)]), r"return two things: corners, and"),
    "outline of 2D only": (outline(lambda shape, dimensions: (QUAD, ()), (2, 3)), "rows of 3 finite numbers"),
    "outline without corners": (outline(lambda shape, dimensions: ([], ())), "at least one"),
    "outline is NaN": (outline(lambda shape, dimensions: ([(math.nan, 0.0)], ())), "finite numbers"),
    "outline with a face of two": (outline(lambda shape, dimensions: (QUAD, [(0, 1)])), "three or more different rows"),
    "outline with a strange face": (outline(lambda shape, dimensions: (QUAD, [(0, 1, 4)])), "not among the 4"),
    "outline in space without faces": (
        outline(lambda shape, dimensions: (SIGNS[3], ()), dimensions=(3,)), "more than two corners need faces"
    ),
    "outline too large": (outline(lambda shape, dimensions: (1.1 * QUAD, ())), "outline reaches .*, bounds are"),
    "edge of another side": (edged(lambda shape, d: ((0.5, -0.5), (0.5, 0.5))), "support reaches farther"),
    "edge clockwise": (edged(lambda shape, d: AABBCollider.edge(LEVEL, d)[::-1]), "end to end counter-clockwise"),
    "edge is one point": (edged(lambda shape, d: (0.5, 0.5)), "returned"),
    "outline too small": (outline(lambda shape, dimensions: (0.9 * QUAD, ())), "reaches 0.636[0-9]*, support 0.707"),
    "outline with a corner cut off": (outline(lambda shape, dimensions: (QUAD[:3], ())), "the outline reaches"),
    "outline beside the core": (
        shape(**ROUND, outline=lambda shape, dimensions: ([(0.1,) * dimensions], ())), "outline reaches .*, bounds"
    ),
    "outline clockwise": (outline(lambda shape, dimensions: (QUAD[::-1], ())), "not convex, or is clockwise"),
    "outline that crosses itself": (outline(lambda shape, dimensions: (QUAD[[0, 2, 1, 3]], ())), "not convex"),
    "outline with a face inside out": (
        outline(lambda shape, dimensions: (SIGNS[3] / 2, [FACES[3][0][::-1], *FACES[3][1:]]), dimensions=(3,)),
        "a face of the outline looks inward",
    ),
    "outline with a hole": (
        outline(lambda shape, dimensions: (SIGNS[3] / 2, FACES[3][1:]), dimensions=(3,)), "the outline leave a hole"
    ),
    "strange dimensions": (shape(dimensions=(4,)), r"dimensions must be \(2,\), \(3,\) or \(2, 3\)"),
    # -- what a pair's function is
    "of no class": (
        lambda plugin: plugin.pair(registered(plugin)[1], "sphere")(disc_disc),
        "a pair is of two collider classes, or one and Convex, got 'sphere'",
    ),
    "no function": (pair(math.hypot), "register a plain function"),
    "of Convex without helpers": (
        lambda plugin: plugin.pair(registered(plugin)[1], Convex)(disc_disc),
        r"it must take 5 arguments: \(a, b, d, support, rounding\)",
    ),
    "takes too few": (pair(lambda a, b: None), r"takes \(a, b\), it must take 3 arguments: \(a, b, d\)"),
    "takes any number": (pair(lambda *all: None), r"takes \(\*all\), it must take 3 arguments"),
    "returns a number": (pair(lambda a, b, d: 1.0), r"return \(hit, depth, normal, point\)"),
    "returns three": (pair(lambda a, b, d: (True, 1.0, d)), r"return \(hit, depth, normal, point\)"),
    "hit is a number": (pair(lambda a, b, d: (1, 1.0, d, d)), r"point\): True or False, a number, a tuple"),
    "depth is a vector": (pair(lambda a, b, d: (True, d, d, d)), r"point\): True or False, a number,"),
    "normal is a number": (pair(lambda a, b, d: (True, 1.0, 1.0, d)), "a tuple of 2 numbers, a tuple of 2 numbers"),
    "point is a number": (pair(lambda a, b, d: (True, 1.0, d, 0.0)), "a tuple of 2 numbers, a tuple of 2 numbers"),
    "divides by zero": (
        pair(lambda a, b, d: (True, 1.0 / math.hypot(*d), d, d) if not any(d) else disc_disc(a, b, d)),
        "divides by zero",
    ),
    "raises": (pair(lambda a, b, d: [][1]), "it raised IndexError"),
    "asks for what is not there": (pair(lambda a, b, d: a.radius), r"no attribute 'radius' \(it has reach\)"),
    # -- laws of contacts
    "normal is not unit": (part(lambda hit, depth, n, p: (hit, depth, ones(n), p)), "1.41421, it must be 1: divide it"),
    "depth is NaN": (part(lambda hit, depth, n, p: (hit, math.nan, n, p)), "every value must be finite"),
    "not finite for one centre": (
        pair(lambda a, b, d: (*disc_disc(a, b, d)[:2], divided(d, length(d)), d)),
        "the centres coincide: choose any normal then",
    ),
    "the depth has the wrong sign": (part(lambda hit, depth, n, p: (hit, -depth, n, p)), "hit must be depth >= 0"),
    "apart it does not tell how far": (
        part(lambda hit, depth, n, p: (hit, depth if hit else -math.inf, n, p)),
        "apart, its depth is minus infinity: return minus the gap",
    ),
    "depth too large": (
        round_part(lambda hit, depth, n, p: (hit, 2 * depth if hit else depth, n, p)), "moved apart by that they are"
    ),
    "depth too small": (
        round_part(lambda hit, depth, n, p: (hit, depth / 2 if hit else depth, n, p)),
        "moved apart by that they still overlap, by",
    ),
    "a normal to the first": (
        round_part(lambda hit, depth, n, p: (hit, depth, negative(n), p)),
        "normal points from the first shape to the second",
    ),
    "a normal that does not turn round": (
        part(lambda hit, depth, n, p: (hit, depth, n if n[0] > 0 else negative(n), p)), "a and b may change places"
    ),
    "touching too late": (
        round_part(lambda hit, depth, n, p: (hit and depth > 0.2, depth - 0.2, n, p)), "by their support functions"
    ),
    "distance too long": (
        part(lambda hit, depth, n, p: (hit, depth if hit else 3 * depth, n, p)), "apart, depth is minus the distance"
    ),
    "depth beyond the boxes": (
        part(lambda hit, depth, n, p: (True, depth + 9.0, n, p)), "they overlap by .* but their boxes do not"
    ),
    "point from the wrong centre": (
        part(lambda hit, depth, n, p: (hit, depth, n, scale(n, 2.0))), "is outside of one of the shapes"
    ),
    # -- sweeps, corners
    "sweep of no pair": (
        lambda plugin: plugin.sweep(SphereCollider, SphereCollider)(lambda a, b, d, v: (False, 1.0)),
        "register the pair itself first",
    ),
    "sweep returns one value": (sweep(lambda a, b, d, v: (True,)), r"return \(hit, time\)"),
    "sweep's time is NaN": (sweep(lambda a, b, d, v: (True, math.nan)), "from 0 to 1"),
    "sweep's time is before the start": (sweep(lambda a, b, d, v: (True, -5.0)), "from 0 to 1"),
    "sweep raises": (sweep(lambda a, b, d, v: [][1]), "it raised IndexError"),
    "sweep misses": (sweep(lambda a, b, d, v: (False, 1.0)), "they overlap by .* already"),
    "sweep is late": (
        sweep(lambda a, b, d, v: (first_touch(a, b, d, v)[0], 1.1 * first_touch(a, b, d, v)[1])), "already"
    ),
    "sweep is early": (
        sweep(lambda a, b, d, v: (first_touch(a, b, d, v)[0], 0.9 * first_touch(a, b, d, v)[1])), "do not touch"
    ),
    "corner is a number": (corner(3), "register a plain function"),
    "corner of one argument": (corner(lambda a: True), "it must take 4 arguments"),
    "corner returns a number": (corner(lambda a, b, d, slop: 1), "True or False"),
    # -- other things
    "integrator of no class": (
        lambda plugin: plugin.integrator("jump")(int), r"'jump': register a class .*int has no advance, order, eval"
    ),
    "advance of two arguments": (integrator("advance", lambda self, dt: None), "advance .*it must take 3 arguments"),
    "order is a text": (integrator("order", "a"), "order must be a whole number"),
    "evaluations negative": (integrator("evaluations", -1), "evaluations must be a whole number"),
    "path is a text": (integrator("path", "zigzag"), "path must be a whole number"),
    "broad phase of no class": (
        lambda plugin: plugin.broad_phase("all")(int),
        r"broad phase 'all': register a class with pairs\(lower, upper, moving\)",
    ),
    "broad phase of two arguments": (
        lambda plugin: plugin.broad_phase("all")(type("All", (), {"pairs": lambda self, lower: ()})),
        "it must take 4 arguments",
    ),
    "mixing rule has an order": (
        lambda plugin: plugin.mixing_rule("first")(lambda x, y: x),
        "mixing rule 'first': for x = 1.0, y = 0.25 it returned 1.0, in the other order 0.25: both are one",
    ),
    "mixing rule has an order for few": (
        lambda plugin: plugin.mixing_rule("odd")(lambda x, y: x if x < 0.4 and y < 0.7 else max(x, y)),
        "in the other order",
    ),
    "mixing rule is negative": (
        lambda plugin: plugin.mixing_rule("minus")(lambda x, y: -1.0), "return a number from 0"
    ),
    "mixing rule is a text": (lambda plugin: plugin.mixing_rule("text")(lambda x, y: "a"), "return a number from 0"),
    "pair filter": (lambda plugin: plugin.pair_filter(lambda: None), r"takes \(\), it must take 3 arguments"),
    "system": (lambda plugin: plugin.system(3), "system takes a class"),
    "component": (lambda plugin: plugin.component(7), "register a class derived from Component, got 7"),
    "base of components": (lambda plugin: plugin.component(Collider), "register a class derived from Component, got"),
    "component of another": (
        lambda plugin: plugin.component(type("Fuse", (Component,), {"plugin": "bombs", "left": column(0.0)})),
        "component Fuse says that its plugin is 'bombs'",
    ),
    "event": (lambda plugin: plugin.event(3), "event 3: it needs a name"),
    "record": (lambda plugin: plugin.record({}), "record takes a Schema, got {}"),
    "kernel": (lambda plugin: plugin.kernel(3), "kernel takes a function"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_refused_at_registration(mistake):
    register, message = MISTAKES[mistake]
    plugin = Plugin("discs")
    with pytest.raises(PluginError, match=rf"^plugin discs: .*{message}") as refusal:
        register(plugin)
    assert "\n" not in str(refusal.value)
    added = plugin.adds()
    assert not {"integrators", "broad phases", "mixing rules", "pair filters", "systems"} & {*added}
    assert not {"components", "events", "records"} & {*added}
    assert all(pair.sweep is None for pair in plugin.pairs.values())
    assert "pairs" not in added or "sweep" in mistake


def test_what_obeys_the_laws_is_registered():
    plugin, disc = registered(**ROUND, second_moments=lambda shape, d: (0.0,) * (1 + d + d * (d + 1) // 2))
    plugin.pair(disc, disc)(disc_disc)
    plugin.sweep(disc, disc)(first_touch)
    assert plugin.pairs[disc, disc].sweep is not None
    plugin.pair(disc, disc)(disc_disc)
    assert plugin.pairs[disc, disc].sweep is None  # that of the former function
    with pytest.raises(ValueError, match="a plugin needs a name"):
        Plugin("")


def test_a_pair_is_registered_in_one_order():
    plugin, disc = registered()
    plugin.pair(disc, SphereCollider)(lambda a, b, d: disc_disc(a, disc_like(b.radius), d))
    with pytest.raises(PluginError, match="SphereCollider and DiscCollider is registered already, in the other order"):
        plugin.pair(SphereCollider, disc)(lambda a, b, d: disc_disc(disc_like(a.radius), b, d))


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


def unmarked(r):  # as if @plugin.kernel were forgotten
    return 1.0 * r


@pytest.mark.compiled
def test_a_helper_that_is_no_kernel_is_named_in_the_first_step():
    """Generic pairs take a support by address: it is compiled while the shapes of the scene are looked at."""

    def support(shape, direction):
        return scale(direction, unmarked(shape.reach) / length(direction))

    plugin, disc = registered(support=support)
    with World(Physics(), plugin) as world:
        world.create_entity(Transform((0, 0)), AABBCollider((1, 1)))
        world.create_entity(Transform((0, 1)), RigidBody(), disc(1.0))
        message = "^opening the step failed in step 0 .*shape DiscCollider: support cannot be compiled; functions"
        with pytest.raises(StepError, match=message):
            world.step()


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
