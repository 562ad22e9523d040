"""The registry of a world: what its plugins have brought, and how each pair of shapes meets."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

from ..compilation import inlined
from ..data.component import Component
from ..errors import PluginError
from ..jit.records.schema import Schema
from ..settings import AUTOMATIC, MIXING_RULES
from ..world.events import CONTACT_EVENTS


class Convex:
    """In a pair, any shape that has a support function: ``@plugin.pair(PlaneCollider, Convex)``."""


@inlined
def no_rounding(shape):
    """Of a shape that has none."""
    return 0.0


@dataclass(frozen=True)
class Shape:
    """A collider type that takes part in collisions.

    cost
        of testing it, relative to the sphere's 1; orders the levels of a body that has several
    bounds
        compiled; (shape, dimensions) -> half extents of the box around the shape, a tuple of d
    turned
        compiled, or None if rotation changes nothing; (shape, rotation matrix (d, d)) -> tuple of parameters
    support, rounding
        compiled, or None; (shape, direction) -> the core's farthest point that way; (shape) -> how far the shape
        reaches beyond its core
    edge
        compiled, or None; (shape, direction) -> in a plane both ends of the core's edge that looks most that way;
        without a support (shape, direction, point) -> of the straight part of its surface there
    second_moments
        compiled, or None; (shape, dimensions) -> measure, centre, means of products of coordinates
    outline
        plain Python, or None; (shape, dimensions) -> corners and faces, along the axes of its body
    material
        compiled, or None; (shape, point, normal) -> friction, restitution, surface velocity where it is touched
    """

    component: type[Component]
    cost: float
    bounds: Any
    turned: Any | None
    plugin: str
    support: Any | None = None
    rounding: Any | None = None
    edge: Any | None = None
    second_moments: Any | None = None
    outline: Any | None = None
    material: Any | None = None

    @property
    def rotates(self) -> bool:
        """Whether its functions see ``shape.axes``, the body's axes in the world."""
        return bool(getattr(self.component, "rotates", False))

    @property
    def convex(self) -> bool:
        """Whether a plane parts it from whatever convex thing it does not touch."""
        return bool(getattr(self.component, "convex", True))

    @property
    def sharp(self) -> bool:
        """Whether its faces may meet in corners: nothing says that it is rounded."""
        rounding = getattr(self.component, "rounding", None)
        return rounding is None or not rounding(self.component.sample()) > 0.0

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns the pair functions see: the shape's own, without those every collider has."""
        shared = getattr(self.component, "stacked_columns", ())
        return tuple(name for name in self.component.columns if name not in shared)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Fields of the tuple that pair functions get."""
        return (*self.columns, "axes") if self.rotates else self.columns


@dataclass(frozen=True)
class Pair:
    """How two shapes meet: (a, b, d, *helpers) -> (hit, depth, normal, point), d from a's centre to b's, compiled.

    helpers
        the support functions of those of the two that are registered as :class:`Convex`, then their roundings
    corner
        compiled, or None; (a, b, d, slop) -> whether they touch by less than the slop, and only at a corner or an edge
    sweep
        compiled, or None; (a, b, d, v, *helpers) -> (hit, time) of b moving by v relative to a from d on, the time as a
        part of v
    """

    first: type[Any]
    second: type[Any]
    function: Any
    plugin: str
    corner: Any | None = None
    sweep: Any | None = None
    helpers: tuple[Any, ...] = ()

    @property
    def names(self) -> str:
        return f"{self.first.__name__} and {self.second.__name__}"


@dataclass(frozen=True)
class PluginStage:
    """A stage of a step; (state, dt, *records), compiled, at the place that ``anchor`` and ``after`` name.

    anchor, after
        a built-in stage; whether this one runs after it, or before
    records
        what the function gets beside the state: the columns of component types, and records of the plugin's own
    optional
        those of the component types without which it runs all the same
    reads, writes, needed, why
        as of a built-in one
    """

    function: Any
    anchor: str
    after: bool
    records: tuple[type[Component] | Schema, ...]
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    needed: str
    why: str
    plugin: str
    optional: tuple[type[Component], ...] = ()

    @property
    def name(self) -> str:
        return self.function.__name__

    @property
    def components(self) -> tuple[type[Component], ...]:
        return tuple(each for each in self.records if not isinstance(each, Schema))

    @property
    def about(self) -> tuple[type[Component], ...]:
        """The component types that some body must have all of."""
        return tuple(each for each in self.components if each not in self.optional)

    @property
    def schemas(self) -> tuple[Schema, ...]:
        return tuple(each for each in self.records if isinstance(each, Schema))

    @property
    def place(self) -> str:
        """As its author has written it."""
        return f"{'after' if self.after else 'before'}={self.anchor!r}"


# What plugins register by name or class, as messages call it: the attribute of a plugin and of the registry.
REGISTERED = {
    "shape": "shapes", "integrator": "integrators", "broad phase": "broad_phases", "mixing rule": "mixing_rules",
    "stage": "stages", "joint": "joints", "component": "declared", "event": "events", "record": "records",
}  # fmt: skip


@dataclass(eq=False)
class Registry:
    """Everything the plugins of one world have registered; ``version`` changes whenever they register more."""

    plugins: list[Any] = field(default_factory=list)
    world: Any = None  # once its plugins are installed
    version: int = 0
    shapes: dict[type[Component], Shape] = field(default_factory=dict)
    pairs: dict[tuple[type[Any], type[Any]], Pair] = field(default_factory=dict)
    integrators: dict[str, Any] = field(default_factory=dict)
    broad_phases: dict[str, Any] = field(default_factory=dict)
    mixing_rules: dict[str, Any] = field(default_factory=dict)
    pair_filters: list[tuple[str, Any]] = field(default_factory=list)  # (plugin, function)
    stages: dict[str, PluginStage] = field(default_factory=dict)
    joints: dict[type[Component], Any] = field(default_factory=dict)
    declared: dict[type[Component], Any] = field(default_factory=dict)
    events: dict[str, str] = field(default_factory=dict)
    records: dict[str, Schema] = field(default_factory=dict)
    # of the world, called with components and events: PluginError for what it cannot have
    declare: Callable[[Iterable[type[Component]], Iterable[str]], None] = lambda components, events: None
    check_stages: Callable[[Iterable[PluginStage]], Any] = tuple  # PluginError for what no step can have

    def require(self, component: type[Component], entity: int | None = None) -> None:
        """ValueError if the plugin is missing without which a component does nothing."""
        needed = component.plugin
        if not needed:
            return
        said = f"{'' if entity is None else f'entity {entity}: '}{component.__name__} does nothing without "
        holder = next((plugin for plugin in self.plugins if plugin.name == needed), None)
        if holder is None:
            written = component.plugin_class or needed.capitalize()
            raise ValueError(f"{said}its plugin: World(Physics(...), {written}()), from carom.plugins.{needed}")
        if holder.components and component not in (*holder.components, *self.joints):
            raise ValueError(f"{said}the plugin that registers it with @plugin.joint: World(..., Joints(), plugin)")

    def add(self, plugin: Any) -> None:
        """PluginError if something of it is registered already; what it registers later is seen too."""
        self.plugins.append(plugin)
        try:
            self.refresh()
        except PluginError:
            self.plugins.remove(plugin)
            raise
        plugin.registries.add(self)

    def drop(self, plugin: Any) -> None:
        """Forget a plugin again."""
        plugin.registries.discard(self)
        self.plugins.remove(plugin)
        self.refresh()

    def refresh(self) -> None:
        """Gather everything anew; PluginError if two plugins want the same, and then nothing changes."""
        gathered: dict[str, dict[Any, Any]] = {attribute: {} for attribute in REGISTERED.values()}
        pairs: dict[Any, Any] = {}
        owners: dict[Any, str] = {}
        for plugin in self.plugins:
            for kind, attribute in REGISTERED.items():
                known, fresh = gathered[attribute], getattr(plugin, attribute)
                for key in fresh:
                    name = key if isinstance(key, str) else key.__name__
                    if key in known:
                        raise PluginError(
                            f"plugin {plugin.name}: {kind} {name} is registered already, by plugin {owners[kind, key]}"
                        )
                    owners[kind, key] = plugin.name
                    classes = (each for each in known if not isinstance(each, str))
                    twin = next((each for each in classes if each.prefix == key.prefix), None)
                    if twin is not None:
                        raise PluginError(
                            f"plugin {plugin.name}: {kind} {name} goes by the name of another class, of plugin "
                            f"{owners[kind, twin]}: columns are named after the class, so give it another name"
                        )
                    if key in (CONTACT_EVENTS if kind == "event" else (*MIXING_RULES, AUTOMATIC)):
                        raise PluginError(f"plugin {plugin.name}: {kind} {name} is one of carom's own names")
                known.update(fresh)
            for (first, second), pair in plugin.pairs.items():
                other = pairs.get((first, second)) or pairs.get((second, first))
                if other is not None:
                    raise PluginError(
                        f"plugin {plugin.name}: the pair of {pair.names} is registered already, by plugin "
                        f"{other.plugin}"
                    )
                pairs[first, second] = pair
        self.check_stages(gathered["stages"].values())
        self.declare(gathered["declared"], gathered["events"])
        vars(self).update(gathered, pairs=pairs)
        self.pair_filters = [(plugin.name, each) for plugin in self.plugins for each in plugin.pair_filters]
        self.version += 1

    def pair(self, first: type[Any], second: type[Any]) -> Pair | None:
        """How two shapes meet: the pair registered for both, in whichever order; else for one and anything convex; else
        for any two convex shapes; else None."""
        exact = self.pairs.get((first, second)) or self.pairs.get((second, first))
        if exact is not None:
            return exact
        for one, other in ((first, second), (second, first)):
            general = self._with_convex(one, Convex, other) or self._with_convex(Convex, one, other)
            if general is not None:
                return general
        general = self.pairs.get((Convex, Convex))
        one, other = self.shapes.get(first), self.shapes.get(second)
        if general is None or one is None or other is None or one.support is None or other.support is None:
            return None
        helpers = (one.support, other.support, one.rounding or no_rounding, other.rounding or no_rounding)
        return replace(general, first=first, second=second, helpers=helpers)

    def _with_convex(self, first: type[Any], second: type[Any], convex: type[Any]) -> Pair | None:
        """The pair registered for one shape and Convex, made for a particular convex shape."""
        pair, shape = self.pairs.get((first, second)), self.shapes.get(convex)
        if pair is None or shape is None or shape.support is None or (first is Convex and second is Convex):
            return None
        sides = {"first": convex} if first is Convex else {"second": convex}
        return replace(pair, **sides, helpers=(shape.support, shape.rounding or no_rounding))

    def unhandled(self, first: type[Component], second: type[Component], where: str = "") -> str:
        """What to say of a pair that no plugin handles."""
        plain = [c.__name__ for c in (first, second) if c in self.shapes and self.shapes[c].support is None]
        convex = f", give {' and '.join(dict.fromkeys(plain))} a support function" if plain else ""
        return (
            f"{first.__name__} and {second.__name__} can meet in this world{where}, but no plugin has registered the "
            f"pair: register it with @plugin.pair{convex}, or keep them apart with layer and mask"
        )
