"""``carom run``: run a scene, and show what happened."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import click
import numpy as np

from ...framework import CaromError, Settings, World
from ...framework.schedule.profile_report import Stats
from ..measure.run import Drift, RunReport, run
from ..plugins.command import plugin_named
from ..reporting.output import drawing_if_there
from ..reporting.progress import Progress
from ..reporting.text import NOTHING, TextTable, counted, jsonable, number, plain_console, values_text
from .loading import Loaded, load, stdout_kept_clean
from .options import (
    NOT_NEGATIVE,
    Corners,
    View,
    Whole,
    json_option,
    traceback_option,
    world_options,
    writable_folder,
)
from .usage_errors import Problem, one_line

DEFAULT_SECONDS = 10.0  # seconds, for a file that does not define it


@click.command("run", short_help="Run a scene or a file and show what happened.")
@click.argument("target", metavar="SCENE|FILE")
@click.option("--steps", type=Whole(min=0), help="How many steps to take.")
@click.option("--seconds", type=NOT_NEGATIVE, help="How long to simulate (default: what the scene recommends).")
@world_options
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("out"), show_default=True,
    help="The folder where pictures go, or a file for that of the paths: NAME.png.",
)  # fmt: skip
@click.option(
    "--record", type=click.Path(path_type=Path), metavar="FILE", help="A film: NAME.gif, NAME.webp or NAME.mp4."
)
@click.option("--window", is_flag=True, help="Show it in a window instead, with tools that F1 lists there.")
@click.option("--view", type=View(), metavar="X0,Y0,X1,Y1", help="What the pictures show: two corners.")
@click.option("--level", help="Of a map of LDtk with several levels (default: the first).")
@json_option
@click.option("--no-pictures", is_flag=True, help="Draw nothing.")
@click.option("--profile", is_flag=True, help="Time every kernel, and show where the step's time goes.")
@traceback_option
def run_command(
    target: str, steps: int | None, seconds: float | None, settings: Settings | None, changes: dict[str, Any],
    seed: int, plugins: tuple[str, ...], out: Path, record: Path | None, window: bool, view: Corners | None,
    level: str | None, as_json: bool, no_pictures: bool, profile: bool,
) -> None:  # fmt: skip
    """Run a scene of the library, or a file that defines build(settings, seed=0), and show what happened."""
    if steps is not None and seconds is not None:
        raise Problem("--steps and --seconds exclude each other")
    for name, given in (("--json", as_json), ("--profile", profile)):
        if window and given:
            raise Problem(f"--window and {name} exclude each other")
    added = [plugin_named(name) for name in plugins]
    loaded = load(target, level)
    view = view or loaded.view
    if window:
        world = loaded.build(settings, changes, seed, added)
        _check_view(view, world, loaded)
        _show(world, loaded, view, record, steps * world.settings.dt if steps is not None else seconds)
        return
    # What is missing, or cannot be written, is told before a long run.
    pictures = None if no_pictures else drawing_if_there("pictures.run_pictures", "no pictures,")
    if pictures is not None:
        writable_folder(out.parent if pictures.is_file(out) else out, out)

    world = loaded.build(settings, changes, seed, added)
    _check_view(view, world, loaded)
    if steps is None:
        steps = round((loaded.seconds or DEFAULT_SECONDS if seconds is None else seconds) / world.settings.dt)
    film = None if record is None else _film_of(world, loaded, record, view)

    def after_step(done: int) -> None:
        bar.advance(1)
        if film is not None:
            film.after_step(done)

    with Progress(plain_console(stderr=True)) as bar:
        bar.begin(steps)
        bar.say(loaded.name)
        with loaded.attribute_errors(), stdout_kept_clean():
            finished = run(world, steps, scene=loaded.name, seed=seed, after_step=after_step, profile=profile)
        report = finished.report
        report.compared = loaded.values_of(world)
        bar.say("drawing")
        try:
            if pictures is not None:
                report.pictures += map(str, pictures.draw_run(finished, out, view))
            if film is not None:
                film.close()
                report.pictures.append(str(record))
        except CaromError as error:
            raise Problem(one_line(error)) from error
        except OSError as error:
            raise Problem(f"{error.filename or out}: {error.strerror or error}") from error
    if as_json:
        click.echo(json.dumps(jsonable(report), indent=2, allow_nan=False))
        return
    print_report(report, finished.profile)


def _check_view(view: Corners | None, world: World, loaded: Loaded) -> None:
    if view is not None and len(view[0]) != world.dimensions:
        raise Problem(f"{loaded.name}: view has {len(view[0])} dimensions, the world {world.dimensions}")


def _film_of(world: World, loaded: Loaded, file: Path, view: Corners | None) -> Any:
    """What records it; Problem if it cannot be written, or a package is missing."""
    from ...view.film import Recording

    try:
        above = None if loaded.level_of is None else _pictures_of(loaded.level_of(world), world)
        return Recording(world, file, view, above)
    except CaromError as error:
        raise Problem(f"--record: {one_line(error)}") from error


def _pictures_of(level: Any, world: World) -> Any:
    """Paints the pictures of a map over the shapes in a window."""
    from ...view import Sprites

    sprites = Sprites(world)
    level.add_sprites(sprites)

    def paint(view: Any) -> None:
        level.draw(view.screen, view.camera, seconds=world.time)
        sprites.draw(view.screen, view.camera)

    return paint


def _show(world: World, loaded: Loaded, view: Corners | None, record: Path | None, seconds: float | None) -> None:
    """In a window, until it is closed or so many seconds are simulated."""
    try:
        from ...view.backends import view_class
        from ...view.choice import camera_of

        camera = None
        if view is not None:
            camera = camera_of(world)
            camera.fit(*view)
        with loaded.attribute_errors(), stdout_kept_clean():
            wanted = {} if record is None else {"record": record}
            if loaded.level_of is not None:
                wanted["above"] = _pictures_of(loaded.level_of(world), world)
            shown = view_class(world, bool(wanted))(world, camera=camera, title=f"carom: {loaded.name}", **wanted)
            shown.run(math.inf if seconds is None else seconds)
    except CaromError as error:
        raise Problem(one_line(error)) from error
    milliseconds = world.stats().total
    click.echo(f"{loaded.name}: {counted(world.step_count, 'step')}, {milliseconds:.3g} ms each")
    for line in fault_lines(world.faults):
        click.echo(f"! {line}")
    if record is not None:
        click.echo(f"film: {record}")


# -- what happened, in tables ----------------------------------------------------------------------------


WARNING = "bold yellow"
FAULTS_SHOWN = 3
AT_REST = 1e-2  # of the energy: a smaller kinetic energy is no scale for a drift


def print_report(report: RunReport, profile: Stats | None = None) -> None:
    """Print the tables: settings, cost by system, the profile by kernel if there is one, and accuracy."""
    console = plain_console()
    console.print(f"\n{summary(report)}\n")
    cost(report).show()
    console.print()
    if profile is not None:
        console.print(f"{profile}\n", soft_wrap=True)
        console.print(f"not in it: {report.compile_seconds:.3g} s for the steps that compiled or loaded kernels\n")
    quality(report).show()
    for line in fault_lines(report.faults):
        console.print(f"! {line}", style=WARNING)
    for picture in report.pictures:
        console.print(f"picture: {picture}", soft_wrap=True)


def fault_lines(faults: list[str]) -> list[str]:
    """A line for each kind of fault, with the first entities that have it."""
    kinds: dict[str, list[str]] = {}
    for fault in faults:
        entity, what = re.fullmatch(r"(?:entity (\d+): )?(.*)", fault, re.DOTALL).groups()  # type: ignore[union-attr]
        kinds.setdefault(what, []).extend([entity] * (entity is not None))
    lines = []
    for what, entities in list(kinds.items())[:FAULTS_SHOWN]:
        more = f" and {len(entities) - FAULTS_SHOWN:,} more" * (len(entities) > FAULTS_SHOWN)
        word, each = ("entity", "") if len(entities) == 1 else ("entities", ", each")
        lines.append(f"{word} {', '.join(entities[:FAULTS_SHOWN])}{more}{each}: {what}" if entities else what)
    others = len(kinds) - len(lines)
    return [*lines, f"and {counted(others, 'other fault')}"] if others else lines


def summary(report: RunReport) -> str:
    """Bodies, steps, times and the choice of settings, in three lines."""
    kinds = [f"{report.bodies[kind]:,} {kind}" for kind in ("dynamic", "kinematic", "static") if report.bodies[kind]]
    choice = [f"{name} {report.settings[name]}" for name in ("integrator", "collision", "substeps")]
    took = f"{report.simulated_seconds:.4g} s in {report.wall_seconds:.3g} s"
    kernels = report.kernels_compiled or report.kernels_loaded
    if kernels:
        doing = "compiling" if report.kernels_compiled else "loading"
        took += f" ({report.compile_seconds:.3g} s of it {doing} {counted(kernels, 'kernel')})"
    return "\n".join([
        f"{report.scene}  {report.dimensions}D, {', '.join(kinds) or 'no bodies'}",
        f"{counted(report.steps, 'step')} of {number(report.settings['dt'])} s = {took}",
        f"{', '.join(choice)}, seed {report.seed}",
    ])  # fmt: skip


def cost(report: RunReport) -> TextTable:
    """Milliseconds per step by system; a dash where every step compiled or loaded kernels."""
    total = report.step_milliseconds_mean
    rest = total - sum(report.system_milliseconds.values())
    rows = []
    for name, mean in {**report.system_milliseconds, "everything else": rest, "whole step (mean)": total}.items():
        share = f"{100 * mean / total:.0f} %" if total > 0 else ""
        rows.append((name, f"{max(mean, 0.0):.4f}" if math.isfinite(mean) else NOTHING, share))
    return TextTable("time per step", ("system", "ms per step", "share"), rows)


def quality(report: RunReport) -> TextTable:
    """Contacts, drift, overlap, escapes."""
    contacts = report.contacts
    per_step = f"at the end; {contacts['mean']:.4g} per step, at most {contacts['most']:,}"
    bounced = "in all" if contacts["impacts"] or not contacts["most"] else "nothing bounced"
    rows = [
        ("bodies", f"{report.bodies['total']:,}", ""),
        ("contacts", f"{contacts['end']:,}", per_step),
        ("impacts", f"{contacts['impacts']:,}", bounced),
    ]
    if report.energy:
        rows.append(_energy_row(report.energy, report.energy_changes))
    if report.momentum and not math.isfinite(report.momentum.relative):
        rows.append(("momentum drift", "not representable", "momentum overflows"))
    elif report.momentum and report.momentum_conserved:
        remark = _drift_remark(report.momentum, "all mass times speed")
        rows.append(("momentum drift", f"{100 * report.momentum.relative:.3g} %", remark))
    step = f"in step {report.deepest_overlap_step:,}" if report.deepest_overlap_step else ""
    rows.append(("deepest overlap", f"{report.deepest_overlap:.4g}", step))
    outside, broken = report.escaped["outside"], report.escaped["non_finite"]
    parts = [f"{outside:,} beyond the walls"] * bool(outside) + [f"{broken:,} not finite"] * bool(broken)
    rows.append(("escaped bodies", f"{outside + broken:,}", ", ".join(parts)))
    rows += [(name, values_text(values), "") for name, values in report.compared.items()]
    return TextTable("what happened", ("", "", ""), rows, left=(2,))


def _energy_row(energy: Drift, changes: list[str]) -> tuple[str, str, str]:
    """Of an energy that changes by intent from what to what; else the drift."""
    if not math.isfinite(energy.relative):
        return "energy", "not representable", "energy overflows"
    if changes:
        return "energy", f"{energy.start:.3g} to {energy.end:.3g} J", f"changed by {', '.join(changes)}"
    if energy.scale < AT_REST * np.abs(energy.start):
        return "energy", f"{energy.end:.3g} J", "as at the start"
    return "energy drift", f"{100 * energy.relative:+.3g} %", _drift_remark(energy, "peak kinetic energy")


def _drift_remark(drift: Drift, scale: str) -> str:
    return f"of {scale}; at worst {100 * drift.worst:.3g} %"
