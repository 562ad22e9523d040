"""``carom run``: run a scene, and show what happened."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from ...framework import Settings
from ..measure.run import Run, run
from ..plain import jsonable
from ..plugins.command import plugin_named
from ..reporting.output import drawing_module
from ..reporting.progress import Bar
from ..reporting.run_report import print_report
from .choices import parse_view
from .loading import Loaded, load, stdout_kept_clean
from .options import above_zero, traceback_option, world_options, writable_folder
from .usage_errors import Problem

DEFAULT_SECONDS = 10.0  # seconds, for a file that does not define it


@click.command("run", short_help="Run a scene or a file and show what happened.")
@click.argument("target", metavar="SCENE|FILE.py")
@click.option("--steps", type=click.IntRange(min=0), help="How many steps to take.")
@click.option(
    "--seconds", type=float, callback=above_zero("--seconds", "a number of at least 0", zero=True),
    help="How long to simulate (default: what the scene recommends).",
)  # fmt: skip
@world_options
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("out"),
    show_default=True,
    help="The folder where pictures go, or a file for that of the paths: NAME.png.",
)
@click.option(
    "--record", type=click.Path(path_type=Path), metavar="FILE", help="A picture that moves: NAME.gif or NAME.webp."
)
@click.option("--view", "view_text", metavar="X0,Y0,X1,Y1", help="What the pictures show: two corners.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else, to stdout.")
@click.option("--no-pictures", is_flag=True, help="Draw nothing.")
@click.option("--profile", is_flag=True, help="Time every kernel, and show where the step's time goes.")
@traceback_option
def run_command(
    target: str,
    steps: int | None,
    seconds: float | None,
    settings: Settings | None,
    changes: dict[str, Any],
    seed: int,
    plugins: tuple[str, ...],
    out: Path,
    record: Path | None,
    view_text: str | None,
    as_json: bool,
    no_pictures: bool,
    profile: bool,
) -> None:
    """Run a scene of the library, or a file that defines build(settings, seed=0), and show what happened."""
    if steps is not None and seconds is not None:
        raise Problem("--steps and --seconds exclude each other")
    added = [plugin_named(name) for name in plugins]
    loaded = load(target)
    if view_text is not None:
        loaded = dataclasses.replace(loaded, view=parse_view(view_text))
    draw = _drawing(no_pictures, out)
    films = None if record is None else _recording(record)
    screen = Console(stderr=True)

    world = loaded.build(settings, changes, seed, added)
    if loaded.view is not None and len(loaded.view[0]) != world.dimensions:
        raise Problem(f"{loaded.name}: view has {len(loaded.view[0])} dimensions, the world {world.dimensions}")
    if steps is None:
        wanted = seconds if seconds is not None else (loaded.seconds or DEFAULT_SECONDS)
        steps = round(wanted / world.settings.dt)
    film = None if films is None else films.Recording(world, steps)
    finished = _run_with_progress(loaded, world, steps, seed, screen, profile, film)
    finished.report.compared = loaded.values_of(finished.world)
    if draw is not None:
        with screen.status("drawing ..."):
            try:
                finished.report.pictures = [str(path) for path in draw(finished, out, loaded.view)]
            except OSError as error:
                raise Problem(f"--out {out}: {error.strerror or error}") from error
    if film is not None and record is not None:
        finished.report.pictures.append(_save_film(film, finished, record, loaded, screen))

    if as_json:
        click.echo(json.dumps(jsonable(finished.report), indent=2, allow_nan=False))
        return
    console = Console()
    print_report(finished.report, console, finished.profile)
    for picture in finished.report.pictures:
        console.print(f"picture: {picture}", highlight=False, soft_wrap=True)


def _drawing(no_pictures: bool, out: Path) -> Any:
    """The drawing function, or None; missing packages and permissions are reported before a long run."""
    if no_pictures:
        return None
    try:
        pictures = drawing_module("pictures.run_pictures", "no pictures,")
    except Problem as problem:
        click.echo(f"carom: {problem.message}", err=True)
        return None
    writable_folder(out.parent if pictures.is_file(out) else out, out)
    return pictures.draw_run


def _recording(file: Path) -> Any:
    """The module that records; Problem, before a long run, if it cannot write that file."""
    films = drawing_module("pictures.recording", "--record:")
    if file.suffix.lower() not in films.KINDS:
        raise Problem(f"--record takes a name that ends in {' or '.join(films.KINDS)}, not {file}")
    writable_folder(file.parent, file, "--record")
    return films


def _save_film(film: Any, finished: Run, file: Path, loaded: Loaded, screen: Console) -> str:
    with Bar(screen) as bar:
        bar.begin(len(film.frames))
        bar.say(f"drawing {file.name}")
        try:
            return str(film.save(finished, file, loaded.view, lambda _: bar.advance(1)))
        except OSError as error:
            raise Problem(f"--record {file}: {error.strerror or error}") from error


def _run_with_progress(
    loaded: Loaded, world: Any, steps: int, seed: int, screen: Console, profile: bool, film: Any
) -> Run:
    def after_step(done: int) -> None:
        bar.advance(1)
        if film is not None:
            film.after_step(done)

    with Bar(screen) as bar, loaded.attribute_errors(), stdout_kept_clean():
        bar.begin(steps)
        bar.say(loaded.name)
        return run(world, steps, scene=loaded.name, seed=seed, after_step=after_step, profile=profile)
