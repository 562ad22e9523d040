"""``carom plugins``: plugins of installed packages; ``carom plugins check``: check a plugin's functions."""

from __future__ import annotations

import importlib
import importlib.metadata
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import click
from rich.console import Console

from ...framework import Plugin, PluginError
from ...framework.plugins.discovery import GROUP, find, offers
from ..cli.group import Commands
from ..cli.loading import import_file, module_of, stdout_kept_clean
from ..cli.options import traceback_option
from ..cli.usage_errors import Problem, did_you_mean, one_line
from ..reporting.progress import Progress
from ..reporting.text import TextTable, counted, plain_console
from .check import Checked, check_plugin

FOUND = 1  # exit code of a check with findings


@click.group("plugins", cls=Commands, invoke_without_command=True, short_help="List plugins, or check one.")
@traceback_option
@click.pass_context
def plugins_command(context: click.Context) -> None:
    """List the plugins that installed packages offer: name, version, package, what each adds."""
    if context.invoked_subcommand is not None:
        return
    with stdout_kept_clean():
        on_offer = offers()
    if not on_offer:
        click.echo("no installed package offers a plugin")
        return
    rows = []
    for offer in on_offer:
        version, adds = offer.version, f"broken: {offer.problem}"
        if offer.plugin is not None:
            version = offer.plugin.version or offer.version
            adds = f"{offer.problem}; {_adds(offer.plugin)}" if offer.problem else _adds(offer.plugin)
        rows.append((offer.name, version, offer.package, adds))
    TextTable("", ("plugin", "version", "package", "adds"), rows, words=4, left=(0,)).show()


@plugins_command.command("check", short_help="Try a plugin with thousands of random and extreme inputs.")
@click.argument("target", metavar="NAME|MODULE|FILE.py")
@traceback_option
def check_command(target: str) -> int:
    """Check what a plugin brings, compiled as worlds compile it; exit code 1 if something is wrong.

    TARGET: the name of an installed plugin, a module, or a file; all plugins that it defines are checked.
    """
    found = plugins_of(target)
    console, findings = plain_console(), 0
    with Progress(plain_console(stderr=True)) as status:
        for plugin in found:
            with stdout_kept_clean():
                report = check_plugin(plugin, needed_by(plugin), lambda what, p=plugin: status.say(f"{p.name}: {what}"))
            findings += _print(plugin, report, console)
    return FOUND if findings else 0


def _adds(plugin: Plugin) -> str:
    adds = plugin.adds()
    return "; ".join(f"{kind} {', '.join(names)}" for kind, names in adds.items()) or "nothing"


def _print(plugin: Plugin, report: list[Checked], console: Console) -> int:
    """Print the table and the findings; how many there are."""
    rows = [
        (f"{checked.kind} {checked.name}", f"{checked.dimensions}D" if checked.dimensions else "",
         f"{checked.inputs:,}" if checked.inputs else "", _result(checked))
        for checked in report
    ]  # fmt: skip
    TextTable(f"plugin {plugin.name}", ("checked", "", "inputs", "result"), rows, left=(3,)).show()
    lines, found = [], [checked for checked in report if checked.finding]
    for number, checked in enumerate(found, 1):
        what, example, cure = checked.finding or ("", "", "")
        lines += [f"{number}. {checked.place}: {what}", f"   for {example}", f"   cure: {cure}"]
    lines.append(f"plugin {plugin.name}: {counted(len(found), 'finding') if found else 'nothing found'}")
    for line in lines:
        console.print(line, soft_wrap=True)
    return len(found)


def _result(checked: Checked) -> str:
    result = "1 finding" if checked.finding else "ok" if checked.inputs else ""
    return "; ".join(part for part in (result, checked.note) if part)


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
    for component in {component for pair in plugin.pairs for component in pair if component not in plugin.shapes}:
        module = module_of(component)
        for value in vars(module).values() if module is not None else ():
            if isinstance(value, Plugin) and component in value.shapes:
                needed[value] = None
    return sorted(needed, key=lambda each: each.name)
