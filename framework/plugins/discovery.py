"""Plugins that installed packages offer by name, in the entry-point group ``carom.plugins``.

A world never loads one by itself: a program names what it wants.
"""

from __future__ import annotations

import importlib.metadata
from dataclasses import dataclass

from ..errors import PluginError
from .plugin import Plugin

GROUP = "carom.plugins"


@dataclass(frozen=True)
class Offer:
    """An entry point: its name, the package behind it, and the plugin; or, if it cannot be loaded, why."""

    name: str
    package: str
    version: str
    plugin: Plugin | None
    problem: str = ""


def offers() -> list[Offer]:
    """Everything on offer, in order of the names; one that is broken says why, and stops none of the others."""
    points = sorted(importlib.metadata.entry_points(group=GROUP), key=lambda point: (point.name, point.value))
    names = [point.name for point in points]
    return [_load(point, names.count(point.name) > 1) for point in points]


def shipped() -> list[Plugin]:
    """Those that come with carom, in order of the names; PluginError if one is broken, or carom is not installed."""
    try:
        points = importlib.metadata.distribution("carom").entry_points.select(group=GROUP)
    except importlib.metadata.PackageNotFoundError:
        raise PluginError("carom is not installed as a package, so nothing says which plugins ship with it") from None
    found = [_load(point, False) for point in sorted(points, key=lambda point: point.name)]
    for offer in found:
        if offer.plugin is None:
            raise PluginError(f"plugin {offer.name!r} of package {offer.package} cannot be loaded: {offer.problem}")
    return [offer.plugin for offer in found if offer.plugin is not None]


def find(name: str) -> Plugin:
    """The plugin on offer under that name; PluginError if there is none, or if it is broken."""
    known = importlib.metadata.entry_points(group=GROUP)
    found = [_load(point, False) for point in known.select(name=name)]
    if not found:
        names = ", ".join(sorted(point.name for point in known)) or "none"
        raise PluginError(f"no installed package offers a plugin named {name!r}; on offer: {names}")
    if len(found) > 1:
        packages = " and ".join(offer.package for offer in found)
        raise PluginError(f"several installed packages offer a plugin named {name!r}: {packages}")
    if found[0].plugin is None:
        raise PluginError(f"plugin {name!r} of package {found[0].package} cannot be loaded: {found[0].problem}")
    return found[0].plugin


def _load(point: importlib.metadata.EntryPoint, twice: bool) -> Offer:
    package = point.dist.name if point.dist is not None else ""
    version = point.dist.version if point.dist is not None else ""
    plugin, problem = None, ""
    try:
        loaded = point.load()
        plugin = loaded if isinstance(loaded, Plugin) else loaded()
        if not isinstance(plugin, Plugin):
            plugin, problem = None, f"{point.value} is no Plugin and makes none"
    except (Exception, SystemExit) as error:  # somebody else's code: whatever is wrong with it is said in the list
        problem = f"{type(error).__name__}: {error}"
    if twice:
        problem = f"several packages offer this name{f'; {problem}' if problem else ''}"
    return Offer(point.name, package, version, plugin, problem)
