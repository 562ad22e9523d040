"""Plugins: what a world can do, and the decorators that say so."""

from __future__ import annotations

import functools
import inspect
import weakref
from collections.abc import Callable, Iterable
from types import ModuleType
from typing import Any, ParamSpec, TypeVar

from ..compilation import inlined, part, pasted
from ..data.component import Component
from ..errors import NoPhysicsError, PluginError
from ..jit.linking import CACHE_SIZE
from ..jit.records.schema import Schema
from ..settings import Settings
from ..vectors import dot, scale
from . import checks
from .registry import Convex, Pair, PluginStage, Registry, Shape

# One for a function, however many plugins register it, of as many worlds: these share its machine code.
_stage_part = functools.lru_cache(maxsize=CACHE_SIZE)(part)

Thing = TypeVar("Thing")
P = ParamSpec("P")
ShapeClass = TypeVar("ShapeClass", bound=type[Component])


def _called_first(example: str) -> Callable[[Callable[P, Thing]], Callable[P, Thing]]:
    """For decorators with arguments: PluginError if one is put on a class or a function without them."""

    def wrap(method: Callable[P, Thing]) -> Callable[P, Thing]:
        @functools.wraps(method)
        def checked(*args: P.args, **values: P.kwargs) -> Thing:
            if len(args) == 2 and not values and (inspect.isclass(args[1]) or inspect.isfunction(args[1])):
                plugin, thing = args
                raise PluginError(
                    f"plugin {plugin.name}: {method.__name__} on {thing.__name__} takes arguments: "  # type: ignore[attr-defined]
                    f"@plugin.{method.__name__}({example})"
                )
            return method(*args, **values)

        return checked

    return wrap


class Plugin:
    """Something a world can do: shapes, pairs, integrators, systems, rules. ``World(Physics(), plugin)`` takes it.

    name
        of the plugin, in messages and in ``carom plugins``
    version
        of the plugin, for ``carom plugins``
    needs_physics
        whether a world without physics, or one in which it comes before Physics, refuses it with a NoPhysicsError

    Registering is checked at once: a function that cannot work is refused with a PluginError that names it, before
    anything is compiled. What is registered while worlds run is seen at their next step; to register something again
    replaces it. ValueError without a name.
    """

    def __init__(self, name: str, version: str = "", *, needs_physics: bool = False) -> None:
        if not isinstance(name, str) or not name:
            raise ValueError(f"a plugin needs a name, got {name!r}")
        self.name = name
        self.version = version
        self.needs_physics = needs_physics
        self.components: tuple[type[Component], ...] = ()  # those that saved worlds have, beside those of its stages
        self.declared: dict[type[Component], type[Component]] = {}  # those of them that bodies have columns of
        self.events: dict[str, str] = {}
        self.records: dict[str, Schema] = {}
        self.shapes: dict[type[Component], Shape] = {}
        self.pairs: dict[tuple[type[Any], type[Any]], Pair] = {}
        self.integrators: dict[str, Any] = {}
        self.broad_phases: dict[str, Any] = {}
        self.mixing_rules: dict[str, Any] = {}
        self.pair_filters: list[Callable[..., Any]] = []
        self.stages: dict[str, PluginStage] = {}
        self.joints: dict[type[Component], Any] = {}
        self.systems: list[Callable[[], Any]] = []
        self.around_step: dict[str, list[Callable[[Any], None]]] = {"before_step": [], "after_step": []}
        self.registries: weakref.WeakSet[Registry] = weakref.WeakSet()  # of the worlds it is in

    # -- shapes and pairs -------------------------------------------------------------------------

    def kernel(self, function: Thing) -> Thing:
        """For helpers of the functions below: ``function`` is compiled into them, and stays as written for Python."""
        if not inspect.isfunction(function):
            raise PluginError(f"plugin {self.name}: kernel takes a function, got {function!r}")
        return inlined(function)

    @_called_first("cost=2")
    def shape(self, *, cost: float) -> Callable[[ShapeClass], ShapeClass]:
        """Register a collider class as a shape.

        cost
            of testing it, relative to the sphere's 1; of several colliders on one body the cheapest is tested first

        The class defines ``bounds(shape, dimensions)``, the half extents of the box around it as a tuple; it may define
        ``support(shape, direction)``, its farthest point from its centre in a direction (of any length but 0), and with
        it meets every other convex shape; and ``rounding(shape)``, how far it reaches beyond the core that support is
        about; and in 2D ``edge(shape, direction)``, both ends, counter-clockwise, of the core's edge that looks most in
        a direction: without it the two points in which what spins touches it come from its support, in twice the time;
        without a support ``edge(shape, direction, point)``, of the straight part of its surface at a point from its
        centre, twice that point if there is none: what spins touches it in one point else;
        and ``second_moments(shape, dimensions)``, from which bodies that spin get their inertia: its area or
        volume, its centre, then the means over it of xx, xy, yy, in 3D of xx, yy, zz, xy, xz, yz, of a body that is not
        rotated; and ``outline(shape, dimensions)``, what it looks like along its body's axes: ``(corners, faces)`` of a
        :class:`carom.framework.outlines.Outline`, without which pictures ask its support; and ``turned(shape, axes)``,
        a tuple of its fields as they are on a body with these axes. In place of that ``rotates = True`` in the class
        gives the functions ``shape.axes``, the body's axes in the world; and ``material(shape, point, normal)``:
        (friction, restitution, surface velocity) where it is touched, at a point from its centre, the normal leading
        away; nan for what is as the collider's own, which must be the most that its restitution is anywhere, and not 0
        if its surface runs somewhere;
        ``dimensions = (2,)`` makes it a shape of 2D worlds only.
        """

        def register(component: ShapeClass) -> ShapeClass:
            checks.check_shape(self, component, cost)
            bounds, support, rounding, edge, turned, outline, moments, material = (
                checks.shape_function(component, name) for name in checks.SHAPE_FUNCTIONS
            )
            shape = Shape(
                component, float(cost), pasted(bounds), None if turned is None else inlined(turned), self.name,
                None if support is None else checked_support(inlined(support)),
                None if rounding is None else inlined(rounding), None if edge is None else inlined(edge),
                None if moments is None else pasted(moments), outline,
                None if material is None else inlined(material),
            )  # fmt: skip
            self._register(self.shapes, component, shape)
            return component

        return register

    @_called_first("First, Second")
    def pair(
        self, first: type[Any], second: type[Any], *, corner: Any | None = None
    ) -> Callable[[Thing], Thing]:
        """Register ``function(a, b, d) -> (hit, depth, normal, point)`` for two shapes, ``first`` and ``second``.

        a and b have the shapes' fields, d is the vector from a's centre to b's, a tuple of 2 or 3. ``depth`` is how far
        they overlap, negative when they are apart; ``normal`` a unit vector from a to b; ``point`` the point of contact
        relative to a's centre. One function serves overlap, contact and time of impact, both orders, and 2D and 3D if
        it can. ``second`` may be :class:`Convex`, all shapes with a support function: the function then gets that and
        the rounding as further arguments.

        ``corner(a, b, d, slop)`` may tell a touch of two corners, which pushes nothing: what slides over a row of such
        shapes would catch there. With Convex it gets support and rounding, too.
        """

        def register(function: Any) -> Any:
            checks.check_pair(self, first, second, function)
            checks.check_corner(self, first, second, corner)
            compiled = None if corner is None else inlined(corner)
            pair = Pair(first, second, _compiled(function), self.name, compiled)
            if (second, first) in self.pairs and first is not second:
                raise PluginError(
                    f"plugin {self.name}: the pair of {pair.names} is registered already, in the other order"
                )
            self._register(self.pairs, (first, second), pair)
            return function

        return register

    @_called_first("First, Second")
    def sweep(self, first: type[Any], second: type[Any]) -> Callable[[Thing], Thing]:
        """Register ``function(a, b, d, v) -> (hit, time)`` for the pair of ``first`` and ``second``: b moves by v
        relative to a, from d on; time, 0 to 1, is the part of v after which they touch. Without it the time is found
        from the pair's depth.
        """

        def register(function: Any) -> Any:
            checks.check_sweep(self, first, second, function)
            pair = self.pairs[first, second]
            changed = Pair(first, second, pair.function, self.name, pair.corner, inlined(function))
            self._register(self.pairs, (first, second), changed)
            return function

        return register

    # -- what its systems use ---------------------------------------------------------------------

    def component(self, component: ShapeClass) -> ShapeClass:
        """Register a class of components: ``bodies`` of each world with the plugin have its columns, whether a body has
        one or not, and files hold them. PluginError if bodies have columns of these names already."""
        checks.check_component(self, component)
        self._register(self.declared, component, component)
        self.components = tuple(dict.fromkeys((*self.components, component)))
        return component

    def event(self, *names: str) -> None:
        """Register events by their ``names``: ``world.on(name, handler)`` takes them, and its systems send them with
        ``world.dispatch_event(name, ...)``."""
        for name in names:
            checks.check_name(f"plugin {self.name}: event {name!r}", name)
            self._register(self.events, name, name)

    def record(self, schema: Schema) -> Schema:
        """Register a record of numbers and columns that belong to no body: each world that takes the plugin has one,
        ``world.record(schema)``. What is in it belongs to snapshots and files."""
        checks.check_record(self, schema)
        self._register(self.records, schema.name, schema)
        return schema

    # -- other things -----------------------------------------------------------------------------

    def joint(self, component: ShapeClass) -> ShapeClass:
        """Register a class derived from :class:`carom.plugins.joints.Joint`, whose rows its function gives.

        ``constraint(joint, a, b)`` gets the fields of the joint, and of each body ``position`` and ``axes``; it returns
        ``(value, along_a, turn_a, along_b, turn_b)``, vectors of d numbers, in 2D a turn is ``(turn, 0.0)``: the
        value changes by ``along_a . v_a + turn_a . w_a + along_b . v_b + turn_b . w_b`` per second. Without a value,
        ``None``, it is the sum of these changes. Several rows are a tuple of such. ``rows`` of the class says what is
        done about the values: if nothing else is said, the first one stays as it was. ``dimensions = (2,)`` in the
        class makes it a joint of 2D worlds only.
        """
        take = getattr(component, "of_plugin", None)
        if take is None:
            raise PluginError(
                f"plugin {self.name}: joint {getattr(component, '__name__', component)!s} cannot be a joint: derive a "
                f"class from carom.plugins.joints.Joint, and give it columns a and b"
            )
        self._register(self.joints, component, take(self))
        return component

    @_called_first("'name'")
    def integrator(self, name: str) -> Callable[[Thing], Thing]:
        """Register an integrator under the name that ``Settings.integrator`` uses."""

        def register(integrator: Any) -> Any:
            checks.check_integrator(self, name, integrator)
            self._register(self.integrators, name, integrator)
            return integrator

        return register

    @_called_first("'name'")
    def broad_phase(self, name: str) -> Callable[[Thing], Thing]:
        """Register a broad phase under the name that ``Settings.broad_phase`` uses: a class, one instance per world.

        ``pairs(lower, upper, moving)`` gets the boxes (n, d) around the motion of all bodies, the first ``moving`` of
        which move; it returns two integer arrays, rows of bodies whose boxes overlap, each pair once, at least one of
        both below ``moving``. Pairs too many cost time, pairs missing are contacts missed. Boxes with NaN meet nothing.
        """

        def register(broad_phase: Any) -> Any:
            checks.check_broad_phase(self, name, broad_phase)
            self._register(self.broad_phases, name, broad_phase)
            return broad_phase

        return register

    @_called_first("'name'")
    def mixing_rule(self, name: str) -> Callable[[Thing], Thing]:
        """Register ``function(x, y)``, how the restitutions or frictions of two bodies become the contact's, under the
        name that ``Settings`` uses. Compiled, symmetric, not negative."""

        def register(function: Any) -> Any:
            checks.check_mixing_rule(self, name, function)
            self._register(self.mixing_rules, name, inlined(function))
            return function

        return register

    def pair_filter(self, function: Thing) -> Thing:
        """Register ``function(bodies, a, b)``: which of the pairs of rows a[i], b[i] (arrays; the entity of a has the
        smaller id) may meet, as an array of bool. Called in each step with the pairs whose boxes touch; layers and
        masks decide too.
        """
        checks.check_filter(self, function)
        if function not in self.pair_filters:
            self.pair_filters.append(function)  # type: ignore[arg-type]
            self._refresh(lambda: self.pair_filters.remove(function))  # type: ignore[arg-type]
        return function

    @_called_first("after='sum_forces', writes=('force',)")
    def stage(
        self, *, after: str = "", before: str = "", records: tuple[type[Component] | Schema, ...] = (),
        reads: Iterable[str] = (), writes: Iterable[str] = (), needed: str = "",
        optional: tuple[type[Component], ...] = (),
    ) -> Callable[[Thing], Thing]:  # fmt: skip
        """Register ``function(state, dt, *records)``, a compiled stage of a step, next to a built-in one.

        after, before
            one of the two: the name of a built-in stage, as ``world.plan()`` and docs/architecture.md show it. Several
            at one place run in the order of the world's plugins, those of one plugin in that of registration
        records
            component types: the function gets a record of the columns of each, ``charge.value[i]`` of row i, and runs
            only where some body has them all; ``charge.present[i]``: whether this one has it. Schemas: it gets
            ``world.record(schema)``, and may return how many rows all columns of these need: if there are fewer, they
            get them, and it runs again
        reads, writes
            all columns of the bodies and all records of the state that it uses, "mass" and "charge.value". A step that
            fails puts back the columns that are written
        needed
            what has to be true of the world for it to run, as of a built-in stage: "colliders" and the like
        optional
            component types whose records the function gets after the others, and without which it runs all the same

        ``state`` is what the built-in stages get. Bodies that take part in the step have the rows from ``state.first``
        on; the first ``state.dynamic`` rows are dynamic, ``state.moving`` move.
        """

        def register(function: Any) -> Any:
            columns = {"reads": reads, "writes": writes}
            place, used = checks.check_stage(self, function, (after, before), (records, optional), columns)
            why = " ".join((inspect.getdoc(function) or "").partition("\n\n")[0].split()).rstrip(".")
            stage = PluginStage(_stage_part(function), place, bool(after), *used, needed, why, self.name, optional)
            self._register(self.stages, stage.name, stage)
            return function

        return register

    def system(self, make: Thing) -> Thing:
        """Register ``make``, a class of System, ForceSystem or processor: each world that takes the plugin gets one."""
        checks.check_system(self, make)
        self.systems.append(make)  # type: ignore[arg-type]
        for registry in list(self.registries):
            if registry.world is not None:
                self._add_systems(registry.world, [make])
        return make

    def before_step(self, function: Thing) -> Thing:
        """Register ``function(world)``, called before each step in which code of the game runs, or bodies or components
        have changed; if it raises, the step does not begin. PluginError for what cannot be called."""
        return self._around_step("before_step", function)

    def after_step(self, function: Thing) -> Thing:
        """Register ``function(world)``, called at the end of each step in which code of the game runs, handlers among
        it, after all systems and stages; if it raises, the step is undone. PluginError for what cannot be called."""
        return self._around_step("after_step", function)

    def _around_step(self, when: str, function: Thing) -> Thing:
        if not callable(function):
            raise PluginError(f"plugin {self.name}: {when} takes a function (world), got {function!r}")
        self.around_step[when].append(function)
        return function

    # -- being taken by a world -------------------------------------------------------------------

    def install(self, world: Any) -> None:
        """Called by the world after all its plugins are registered; all of it, or an error and nothing.

        NoPhysicsError if it needs physics and there is none.
        """
        if self.needs_physics and world.physics is None:
            own = "plugin" if type(self) is Plugin else f"{type(self).__name__}()"
            raise NoPhysicsError(f"plugin {self.name} needs physics before it: World(Physics(...), {own})")
        self._add_systems(world, self.systems)
        if world.physics is not None:
            world.physics.plugin_stages.followers += self.around_step["before_step"]
            world.physics.plugin_stages.finishers += self.around_step["after_step"]

    # -- snapshots --------------------------------------------------------------------------------

    def saved(self, world: Any) -> Any:
        """What the plugin knows of that world and will need to go on, for snapshots and saved worlds; None: nothing.

        A copy, of arrays, numbers, texts, and lists and dicts (by text) of these.
        """
        return None

    def take_back(self, world: Any, saved: Any) -> None:
        """Go on from what :meth:`saved` has returned, here or in another process; the world has its bodies again."""

    def _add_systems(self, world: Any, factories: list[Any]) -> None:
        added: list[Any] = []
        try:
            for make in factories:
                system = make()
                world.add_system(system)
                added.append(system)
        except Exception as error:
            for system in added:
                world.remove_system(system)
            error.add_note(f"plugin {self.name}")
            raise

    def adds(self) -> dict[str, list[str]]:
        """What it brings, by kind, as names; for ``carom plugins``."""
        found = {
            "components": [component.__name__ for component in self.components],
            "shapes": [component.__name__ for component in self.shapes],
            "pairs": [pair.names for pair in self.pairs.values()],
            "integrators": list(self.integrators),
            "broad phases": list(self.broad_phases),
            "mixing rules": list(self.mixing_rules),
            "pair filters": [function.__name__ for function in self.pair_filters],
            "stages": list(self.stages),
            "joints": [component.__name__ for component in self.joints],
            "events": list(self.events),
            "records": list(self.records),
            "systems": [getattr(make, "__name__", repr(make)) for make in self.systems],
        }
        return {kind: names for kind, names in found.items() if names}

    def _register(self, known: dict[Any, Any], key: Any, value: Any) -> None:
        """Put it in; take it out again if a world that has the plugin has something of that name from another."""
        had, before = key in known, known.get(key)
        known[key] = value

        def undo() -> None:
            if had:
                known[key] = before
            else:
                del known[key]

        self._refresh(undo)

    def _refresh(self, undo: Callable[[], None]) -> None:
        registries = list(self.registries)
        try:
            for registry in registries:
                registry.refresh()
        except PluginError:
            undo()
            for registry in registries:
                registry.refresh()
            raise

    def __repr__(self) -> str:
        return f"<plugin {self.name}>"


def _compiled(function: Any) -> Any:
    """A helper is compiled already."""
    return function if hasattr(function, "py_func") else inlined(function)


def checked_support(support: Any) -> Any:
    """The support function, whose answers are looked at: what is made of a wrong one need not look wrong."""

    @inlined
    def finite_support(shape, direction):
        point = support(shape, direction)
        if dot(point, scale(point, 0.0)) != 0.0 and dot(direction, scale(direction, 0.0)) == 0.0:
            raise ValueError("support returned a point that is not finite")
        return point

    finite_support.author = support  # for messages
    return finite_support


def must_be_plugin(rule: str, thing: Any) -> None:
    """TypeError if it is none, with what may be meant."""
    if isinstance(thing, Plugin):
        return
    if isinstance(thing, Settings):
        raise TypeError(f"{rule}, got {thing!r}; settings go by name: World(..., settings=...)")
    names: list[str] = []
    if isinstance(thing, type) and issubclass(thing, Plugin):
        names = [f"{thing.__name__}()"]
    elif isinstance(thing, ModuleType):
        own, name = vars(thing), thing.__name__
        classes = [value for value in own.values() if isinstance(value, type) and value.__module__ == name]
        names = [f"{kind.__name__}()" for kind in classes if issubclass(kind, Plugin)]
        names = names or [key for key, value in own.items() if isinstance(value, Plugin)]
        names = [f"{name.rpartition('.')[2]}.{one}" for one in names]
    meant = f" (did you mean {' or '.join(names)}?)" if names else ""
    raise TypeError(f"{rule}, got {thing!r}{meant}")


__all__ = ["Convex", "Plugin", "must_be_plugin"]
