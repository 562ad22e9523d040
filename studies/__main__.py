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

from . import features, joints, scaling, settings, startup
from .accuracy import accuracy_command
from .bench import timing as bench
from .features import LADDER, SPINS
from .limits import search as limits
from .page import between_marks, into_option, show
from .runner import Axis, Result, run
from .stages import stages_command


@dataclass(frozen=True)
class Study:
    """A table of axes and its report.

    axes: (quick, long) -> all axes; quick: fewer values, long: more
    usual: names of the axes that run if none is named; empty: all
    long: what ``--long`` adds; empty: nothing
    draw: draws a chart into a folder, and returns its path
    """

    what: str
    axes: Callable[[bool, bool], Sequence[Axis]]
    report: Callable[[Result], tuple[list[TextTable], list[str]]]
    repeats: int = 1
    usual: tuple[str, ...] = ()
    long: str = ""
    draw: Callable[[Result, Path], Path] | None = None

    def chosen(self, names: Sequence[str], quick: bool, long: bool) -> list[Axis]:
        """The axes of these names; Problem for a name that there is not."""
        axes = self.axes(quick, long)
        known = list(dict.fromkeys(axis.name for axis in axes))
        for name in names:
            if name not in known:
                raise Problem(f"no axis {name!r}{did_you_mean(name, known)}")
        return [axis for axis in axes if axis.name in (names or self.usual or known)]


def _draw_limits(result: Result, folder: Path) -> Path:
    from .limits.chart import draw  # matplotlib is needed for pictures alone

    return draw(result, folder)


STUDIES = {
    "bench": Study(
        "carom against pymunk and Box2D, on the same bodies.", bench.axes, bench.report, 3, long="100,000 bodies too.",
    ),
    "joints": Study("What substeps and shorter steps buy joints, and what they cost.", joints.axes, joints.report, 5),
    "ladder": Study(
        "What each feature costs, switched on alone.", partial(features.axes, LADDER, features.BODIES),
        partial(features.report, LADDER), 5,
    ),
    "limits": Study(
        "Where carom fails: one quantity at a time, until the error passes 1 % and 10 %, and until it breaks.",
        limits.axes, limits.report, draw=_draw_limits,
    ),
    "scaling": Study(
        "How the time per body grows with their number.", scaling.axes, scaling.report, 3,
        long="A million bodies too: needs some gigabytes.",
    ),
    "settings": Study("What each field of Settings costs and buys.", settings.axes, settings.report, 5),
    "spins": Study(
        "What bodies that turn cost.", partial(features.axes, SPINS, features.TURNING),
        partial(features.report, SPINS), 5,
    ),
    "startup": Study(
        "The time to the first step of a new process, by scene.", startup.axes, startup.report, 3,
        usual=(startup.COMMANDS_AXIS, "asteroids"),
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
        names: tuple[str, ...], quick: bool, repeats: int | None, into: Path | None, long: bool = False,
        out: Path | None = None,
    ) -> None:  # fmt: skip
        if quick and long:
            raise Problem("--quick and --long exclude each other")
        axes, mark = study.chosen(names, quick, long), f"studies {name}"
        if into is not None:
            between_marks(into, mark)  # Problem, before the long run, for a page without the marks
        if out is not None:
            writable_folder(out)
        with Progress(Console(stderr=True)) as bar:
            result = run(axes, repeats or (1 if quick else study.repeats), bar)
        show(*study.report(result), into, mark)
        if out is not None and study.draw is not None:
            click.echo(f"chart: {study.draw(result, out)}", err=True)

    if study.long:
        command = click.option("--long", is_flag=True, help=study.long)(command)
    if study.draw is not None:
        command = out_option("Draw a chart into this folder.")(command)
    return command


for _name, _study in STUDIES.items():
    cli.add_command(_command(_name, _study))
for _other in (accuracy_command, stages_command):
    cli.add_command(_other)

if __name__ == "__main__":
    in_command(cli)
