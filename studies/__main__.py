"""``python -m studies NAME``: measure again what a table of the docs shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import click
from rich.console import Console

from carom.lab.cli.group import Commands
from carom.lab.cli.main import in_command
from carom.lab.cli.options import out_option, traceback_option, writable_folder
from carom.lab.cli.usage_errors import Problem, did_you_mean
from carom.lab.reporting.progress import Progress
from carom.lab.reporting.text import TextTable

from . import accuracy, characters, features, joints, scaling, settings, startup
from .bench import timing as bench
from .features import LADDER, SPINS
from .limits import search as limits
from .page import between_marks, into_option, show, with_a_palette
from .runner import Axis, Result, run
from .stages import stages_command


@dataclass(frozen=True)
class Study:
    """A table of axes and its report.

    axes: (quick) -> all axes; quick: fewer values
    usual: names of the axes that run if none is named; empty: all
    draw: draws charts into a folder, and returns their paths
    """

    what: str
    axes: Callable[[bool], Sequence[Axis]]
    report: Callable[[Result], tuple[list[TextTable], list[str]]]
    repeats: int = 1
    usual: tuple[str, ...] = ()
    draw: Callable[[Result, Path], list[Path]] | None = None

    def chosen(self, names: Sequence[str], quick: bool) -> list[Axis]:
        """The axes of these names; Problem for a name that there is not."""
        axes = self.axes(quick)
        known = list(dict.fromkeys(axis.name for axis in axes))
        for name in names:
            if name not in known:
                raise Problem(f"no axis {name!r}{did_you_mean(name, known)}")
        return [axis for axis in axes if axis.name in (names or self.usual or known)]


STUDIES = {
    "accuracy": Study(
        "What methods and steps buy in scenes with a known answer.", accuracy.axes, accuracy.report,
        draw=accuracy.draw_charts,
    ),
    "bench": Study("carom against pymunk and Box2D, on the same bodies.", bench.axes, bench.report, 3),
    "characters": Study(
        "What characters cost, many and one beside pymunk.", characters.axes, characters.report, 3,
    ),
    "joints": Study("What substeps and shorter steps buy joints, and what they cost.", joints.axes, joints.report, 5),
    "ladder": Study(
        "What each feature costs, switched on alone.", partial(features.axes, LADDER, features.BODIES),
        partial(features.report, LADDER), 5,
    ),
    "limits": Study(
        "Where carom fails: one quantity at a time, until the error passes 1 % and 10 %, and until it breaks.",
        limits.axes, limits.report, draw=limits.draw_chart,
    ),
    "scaling": Study("How the time per body grows with their number.", scaling.axes, scaling.report, 3),
    "settings": Study("What each field of Settings costs and buys.", settings.axes, settings.report, 5),
    "spins": Study(
        "What bodies that turn cost.", partial(features.axes, SPINS, features.TURNING),
        partial(features.report, SPINS), 5,
    ),
    "startup": Study(
        "The time to the first step of a new process, by scene.", startup.axes, startup.report, 3,
        usual=("asteroids",),
    ),
}  # fmt: skip


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
def cli() -> None:
    """Studies that measure what the tables and charts of carom's docs show."""


def _command(name: str, study: Study) -> click.Command:
    @click.command(name, help=f"{study.what} AXIS: only these of the study's axes.", short_help=study.what)
    @click.argument("names", metavar="[AXIS...]", nargs=-1)
    @click.option("--quick", is_flag=True, help="One repeat, and fewer values.")
    @click.option("--repeats", type=click.IntRange(min=1), metavar="N", help=f"Runs (default: {study.repeats}).")
    @into_option
    @traceback_option
    def command(
        names: tuple[str, ...], quick: bool, repeats: int | None, into: Path | None, out: Path | None = None
    ) -> None:
        axes, mark = study.chosen(names, quick), f"studies {name}"
        if into is not None:
            between_marks(into, mark)  # Problem, before the long run, for a page without the marks
        if out is not None:
            writable_folder(out)
        with Progress(Console(stderr=True)) as bar:
            result = run(axes, repeats or (1 if quick else study.repeats), bar)
        show(*study.report(result), into, mark)
        for path in study.draw(result, out) if out is not None and study.draw is not None else ():
            with_a_palette(path)
            click.echo(f"chart: {path}", err=True)

    return command if study.draw is None else out_option("Draw charts into this folder.")(command)


for _name, _study in STUDIES.items():
    cli.add_command(_command(_name, _study))
cli.add_command(stages_command)

if __name__ == "__main__":
    in_command(cli)
