"""What ``carom trade`` and ``carom tune`` share: their options as arguments, the runs, and Ctrl-C."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from ..cases.grid import ALL_METHODS
from ..cases.subjects import Subject
from ..cli.group import STOPPED
from ..cli.options import case_options, only_options, runs_options, together
from ..cli.usage_errors import Problem
from ..jobs.cluster import Cluster
from ..jobs.result_store import Store
from ..jobs.runs import STOPPED as STUDY_STOPPED
from ..reporting.progress import Bar
from ..wording import counted
from .trade import Only

study_options = together(case_options, only_options, runs_options)


def arguments_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """The keywords of ``trade`` and ``search`` that the values of ``study_options`` give, without the norms."""
    parts = (given["integrators"], given["collisions"], given["substeps"], given["geometries"])
    return {
        **{name: given[name] for name in ("seconds", "repeats", "options", "seed")},
        "steps": given["steps"] or (),
        "only": Only(*(part or () for part in parts)),
        "budget": None if given["thorough"] else given["budget"],
    }


def check_integrators(subjects: Sequence[Subject], names: Sequence[str]) -> None:
    """Problem, with suggestions, for an integrator that a scene does not have; plugins can add integrators."""
    for subject in subjects:
        for name in names:
            if name not in ALL_METHODS:
                with contextlib.closing(subject.world(None)) as world:
                    settings = world.settings.replace(integrator=name)
                subject.world(settings).close()


@contextlib.contextmanager
def performing(given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """The keywords of what performs and keeps the runs; Ctrl-C ends the command and says what is kept."""
    workers, cluster, kept = given["workers"], given["cluster"], given["kept"]
    if workers is not None and cluster is not None:
        raise Problem("--workers and --cluster exclude each other")
    pool = contextlib.nullcontext(workers) if cluster is None else Cluster(cluster)
    with Store(kept) as store, pool as performs, Bar(Console(stderr=True)) as bar:
        try:
            yield {"workers": performs, "store": store, "progress": bar}
        except KeyboardInterrupt:
            known = counted(len(store), "run")
            click.echo(f"carom: stopped before anything was known; {known} kept in {kept}", err=True)
            raise click.exceptions.Exit(STOPPED) from None


def end_if_stopped(stopped: str, kept: Path) -> None:
    """End the command with its exit code, and say how it goes on, if Ctrl-C has ended the study."""
    if stopped == STUDY_STOPPED:
        click.echo(f"carom: stopped; finished runs are kept in {kept}, the same command goes on", err=True)
        raise click.exceptions.Exit(STOPPED)
