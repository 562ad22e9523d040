"""``carom warm-up``: compile in advance the kernels that scenes, or worlds of all that ships, need."""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import click

from ...framework.compilation import log
from ...framework.jit.cache import CACHE_FOLDER_VARIABLE, cache_contents, cache_folder, clear_cache
from ...framework.jit.link_all import link_all
from ...framework.jit.linkable import Linkable
from ...framework.plugins.discovery import shipped
from ...framework.plugins.registry import Registry
from ...plugins import Physics
from ...systems.linking.preparation import all_functions
from ..reporting.progress import Progress
from ..reporting.text import TextTable, plain_console
from .loading import Loaded, load, stdout_kept_clean
from .options import json_option, traceback_option
from .usage_errors import Problem

STEPS = 10  # of a scene, to compile what its own systems call

Work = tuple[str, Callable[[], None]]


@dataclass
class Row:
    """The kernels that one target needed in addition to the targets before it.

    compiled: kernels and their seconds; found: how many were already in the cache.
    """

    target: str
    compiled: list[tuple[str, float]] = field(default_factory=list)
    found: int = 0
    seconds: float = 0.0  # total, including imports, building and stepping


@click.command("warm-up", short_help="Compile ahead, so that the first run does not wait.")
@click.argument("targets", metavar="[SCENE|FILE.py]...", nargs=-1)
@click.option("--dimensions", type=click.Choice(["2", "3"]), help="Only worlds of so many dimensions.")
@click.option("--clear", is_flag=True, help="Empty the cache folder instead; old versions' kernels are in it too.")
@json_option
@traceback_option
def warm_up_command(
    targets: tuple[str, ...], dimensions: str | None, clear: bool, as_json: bool
) -> None:
    """Compile what the scenes or files need; without any: what worlds of all that ships can need."""
    if clear and (targets or dimensions):
        raise Problem("--clear goes alone: it compiles nothing")
    if targets and dimensions:
        raise Problem("--dimensions and scenes exclude each other: it is for all that ships")
    folder = cache_folder()
    if folder is None:
        raise Problem(f"no folder can be written to keep kernels in; {CACHE_FOLDER_VARIABLE} names one")
    before = cache_contents()[0]
    rows: list[Row] = []
    if clear:
        count, size = clear_cache()
    else:
        with Progress(plain_console(stderr=True)) as status:
            rows = warm_up(_work(targets, [int(dimensions)] if dimensions else [2, 3]), status.say)
    after = cache_contents()
    if as_json:
        cache = {"folder": str(folder), "kernels_before": before, "kernels": after[0], "bytes": after[1]}
        found = {"cache": cache} if clear else {"cache": cache, "targets": [dataclasses.asdict(row) for row in rows]}
        click.echo(json.dumps(found, indent=2))
    elif clear:
        click.echo(f"{count:,} kernels deleted from {folder} ({_megabytes(size)})")
    else:
        _print(rows, folder, before, after)


def warm_up(work: Iterator[Work], say: Callable[[str], None]) -> list[Row]:
    """Do each piece of work, ``say`` its name, and record what compiled."""
    rows = []
    for name, action in work:
        say(name)
        compiled, loaded, started = len(log.compiled), log.loaded, time.perf_counter()
        with stdout_kept_clean():
            action()
        rows.append(Row(name, log.compiled[compiled:], log.loaded - loaded, time.perf_counter() - started))
    return rows


def _work(targets: tuple[str, ...], dimensions: list[int]) -> Iterator[Work]:
    for loaded in [load(name) for name in targets]:  # report missing scenes before anything compiles
        yield loaded.name, partial(_prepare_scene, loaded)
    for d in dimensions if not targets else ():
        yield f"all that ships, {d}D", lambda d=d: link_all(shipped_kernels(d))


def shipped_kernels(dimensions: int) -> Iterator[Linkable]:
    """All that any world of what ships may call, whatever its plugins, bodies, settings and queries."""
    registry = Registry()
    for plugin in (Physics(dimensions=dimensions), *shipped()):
        registry.add(plugin)
    return all_functions(registry, dimensions)


def _prepare_scene(loaded: Loaded) -> None:
    with closing(loaded.build(None, {}, 0)) as world, loaded.attribute_errors():
        world.prepare()
        for _ in range(STEPS):
            world.step()


def _print(rows: list[Row], folder: Path, before: int, after: tuple[int, int]) -> None:
    cells = [(row.target, str(len(row.compiled)), str(row.found), f"{row.seconds:.1f}") for row in rows]
    TextTable("", ("needed by", "compiled", "in the cache already", "seconds"), cells).show()
    text = f"cache: {folder}, {after[0]:,} kernels, {_megabytes(after[1])} ({before:,} kernels before)"
    plain_console().print(text, soft_wrap=True)


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB"

