"""Plugins by name, module or file, from the command line."""

from __future__ import annotations

import importlib
import importlib.metadata
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from ...framework import Plugin, PluginError
from ...framework.plugins.discovery import GROUP, find
from ..cli.loading import import_file, stdout_kept_clean
from ..cli.siblings import module_of
from ..cli.usage_errors import Problem, did_you_mean, one_line


def plugin_named(name: str) -> Plugin:
    """The installed plugin of that name; Problem if there is none or it is broken."""
    known = importlib.metadata.entry_points(group=GROUP).names
    if name not in known:
        raise Problem(f"no installed package offers a plugin named {name!r}{did_you_mean(name, sorted(known))}")
    try:
        with stdout_kept_clean():
            return find(name)
    except PluginError as error:
        raise Problem(one_line(error)) from error


def plugins_of(target: str) -> list[Plugin]:
    """The plugins that a name, a module or a file refers to; Problem if there are none."""
    if target.endswith(".py") or "/" in target:
        return _plugins_in(import_file(Path(target)), target)
    if target in importlib.metadata.entry_points(group=GROUP).names:
        return [plugin_named(target)]
    known = sorted(importlib.metadata.entry_points(group=GROUP).names)
    try:
        with stdout_kept_clean():
            sys.path.insert(0, str(Path.cwd()))  # as `python -m` does: authors check files in the current folder
            try:
                module = importlib.import_module(target)
            finally:
                sys.path.remove(str(Path.cwd()))
    except ModuleNotFoundError as error:
        if error.name is not None and (target == error.name or target.startswith(f"{error.name}.")):
            raise Problem(f"no plugin or module named {target!r}{did_you_mean(target, known)}") from error
        raise Problem(f"{target}: {one_line(error)}") from error
    except (Exception, SystemExit) as error:
        raise Problem(f"{target}: {one_line(error)}") from error
    return _plugins_in(module, target)


def _plugins_in(module: ModuleType, target: str) -> list[Plugin]:
    found = list(dict.fromkeys(value for value in vars(module).values() if isinstance(value, Plugin)))
    if not found:  # a plugin class, instantiated per world
        makers: list[Any] = [v for v in vars(module).values() if isinstance(v, type) and issubclass(v, Plugin)]
        own = [maker for maker in makers if maker.__module__ == module.__name__]
        try:
            found = [maker() for maker in own]
        except (Exception, SystemExit) as error:
            raise Problem(f"{target}: {one_line(error)}") from error
    if not found:
        raise Problem(f"{target} defines no plugin: plugin = Plugin('name')")
    return found


def needed_by(plugin: Plugin) -> list[Plugin]:
    """Other plugins whose shapes its pairs use: those in the modules of these shapes."""
    needed: dict[Plugin, None] = {}
    for component in {component for pair in plugin.pairs for component in pair}:
        module = module_of(component)
        for value in vars(module).values() if module is not None else ():
            if isinstance(value, Plugin) and value is not plugin and component in value.shapes:
                needed[value] = None
    return sorted(needed, key=lambda each: each.name)
