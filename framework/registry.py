"""The registry of a world: shapes, and how each pair of them meets."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from .compilation import inlined
from .component import Component
from .errors import UnhandledPairError

if TYPE_CHECKING:
    from .world import World


@dataclass(frozen=True)
class Shape:
    """A collider type that takes part in collisions.

    cost
        of testing it, relative to the sphere's 1; orders the levels of a body that has several
    bounds
        compiled; (parameters, like) -> half extents of the box around the shape, a tuple of d
    turned
        compiled, or None if rotation changes nothing; (parameters, rotation matrix (d, d)) -> tuple of parameters
    """

    component: type[Component]
    cost: float
    bounds: Any
    turned: Any | None
    plugin: str

    @property
    def parameters(self) -> tuple[str, ...]:
        """The columns the pair functions see: the shape's own, without those every collider has."""
        shared = self.component.stacked_columns  # type: ignore[attr-defined]
        return tuple(name for name in self.component.columns if name not in shared)


@dataclass(frozen=True)
class Pair:
    """How two shapes meet: (a, b, d) -> (hit, depth, normal, point), d from a's centre to b's, compiled.

    corner
        compiled, or None; (a, b, d, slop) -> whether they touch by less than the slop, and only at a corner or an edge
    """

    first: type[Component]
    second: type[Component]
    function: Any
    plugin: str
    corner: Any | None = None


class Plugin:
    """Something a world can do: shapes, pairs, systems. ``install`` is called once per world."""

    def __init__(self, name: str) -> None:
        if not isinstance(name, str) or not name:
            raise ValueError(f"a plugin needs a name, got {name!r}")
        self.name = name
        self.shapes: list[Shape] = []
        self.pairs: list[Pair] = []
        self.integrators: dict[str, Any] = {}

    def shape(self, *, cost: float) -> Callable[[type[Component]], type[Component]]:
        """Register a collider class as a shape. It defines ``bounds(shape, like)`` and may define ``turned``."""

        def register(component: type[Component]) -> type[Component]:
            if not hasattr(component, "bounds"):
                raise TypeError(f"plugin {self.name}: {component.__name__} needs bounds(shape, like)")
            bounds = inlined(inspect.getattr_static(component, "bounds").__func__)
            turned = inspect.getattr_static(component, "turned", None)
            compiled = None if turned is None else inlined(turned.__func__)
            self.shapes.append(Shape(component, cost, bounds, compiled, self.name))
            return component

        return register

    def pair(
        self, first: type[Component], second: type[Component], *, corner: Any | None = None
    ) -> Callable[[Any], Any]:
        """Register the function for two shapes; the registry swaps order and flips the normal itself.

        ``corner(a, b, d, slop)`` may tell a touch of two corners, which pushes nobody: what slides over a row of such
        shapes would catch there.
        """

        def register(function: Any) -> Any:
            compiled = None if corner is None else inlined(corner)
            self.pairs.append(Pair(first, second, inlined(function), self.name, compiled))
            return function

        return register

    def integrator(self, name: str) -> Callable[[Any], Any]:
        """Register an integrator under the name that ``Settings.integrator`` uses."""

        def register(integrator: Any) -> Any:
            self.integrators[name] = integrator
            return integrator

        return register

    def install(self, world: World) -> None:
        """Called by the world after all its plugins are registered."""


@dataclass
class Registry:
    """Everything the plugins of one world have registered."""

    shapes: dict[type[Component], Shape] = field(default_factory=dict)
    pairs: dict[tuple[type[Component], type[Component]], Pair] = field(default_factory=dict)
    integrators: dict[str, Any] = field(default_factory=dict)

    def add(self, plugin: Plugin) -> None:
        """ValueError if a shape, pair or integrator is registered already."""
        for shape in plugin.shapes:
            if shape.component in self.shapes:
                raise ValueError(f"plugin {plugin.name}: shape {shape.component.__name__} is registered already")
        for name in plugin.integrators:
            if name in self.integrators:
                raise ValueError(f"plugin {plugin.name}: integrator {name!r} is registered already")
        for pair in plugin.pairs:
            if self.pair(pair.first, pair.second) is not None:
                names = f"{pair.first.__name__} and {pair.second.__name__}"
                raise ValueError(f"plugin {plugin.name}: the pair of {names} is registered already")
        self.shapes.update({shape.component: shape for shape in plugin.shapes})
        self.pairs.update({(pair.first, pair.second): pair for pair in plugin.pairs})
        self.integrators.update(plugin.integrators)

    def pair(self, first: type[Component], second: type[Component]) -> Pair | None:
        """The pair of two shapes in whichever order it was registered."""
        return self.pairs.get((first, second)) or self.pairs.get((second, first))

    def require_pairs(self, components: list[type[Component]]) -> None:
        """UnhandledPairError if two of these shapes can meet and no plugin says how."""
        for index, first in enumerate(components):
            for second in components[index:]:
                if self.pair(first, second) is None:
                    raise UnhandledPairError(
                        f"{first.__name__} and {second.__name__} can meet in this world, but no plugin has registered "
                        f"the pair: register it with @plugin.pair, or keep them apart with layer and mask"
                    )
