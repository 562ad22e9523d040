"""What ``carom plugins check`` has looked at, and what it found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...framework.plugins.checks import plain, shown
from .samples import KINDS, Poses, Rows


@dataclass
class Finding:
    """Something wrong: what, for which input, and the cure; ``share``: of how many of the inputs it is true."""

    what: str
    example: str
    cure: str
    share: str = ""


@dataclass
class Subject:
    """A shape, a pair or something else that was checked, in one dimension; and the findings."""

    kind: str
    name: str
    dimensions: int | None = None
    inputs: int = 0
    findings: list[Finding] = field(default_factory=list)
    note: str = ""

    def found(self, bad: np.ndarray, what: Any, example: Any, cure: str) -> bool:
        """Note a finding where ``bad`` (n,) is true; ``what`` and ``example`` say it of the first row that is."""
        at = np.flatnonzero(bad)
        if len(at):
            first = int(at[0])
            self.findings.append(Finding(what(first), example(first), cure, f"{len(at)} of {len(bad)}"))
        return len(at) > 0


@dataclass
class Report:
    """Of one plugin."""

    plugin: str
    subjects: list[Subject] = field(default_factory=list)

    @property
    def findings(self) -> int:
        return sum(len(subject.findings) for subject in self.subjects)

    def subject(self, kind: str, name: str, dimensions: int | None = None) -> Subject:
        made = Subject(kind, name, dimensions)
        self.subjects.append(made)
        return made


def pose_shown(poses: Poses, at: int, d: Any = None, swapped: bool = False) -> str:
    """The input of a pair's function."""
    d = poses.d[at] if d is None else d
    a, b = (poses.b, poses.a) if swapped else (poses.a, poses.b)
    return f"{KINDS[poses.kind[at]][0]}: a = {row_shown(a, at)}, b = {row_shown(b, at)}, d = {numbers_shown(d)}"


def row_shown(rows: Rows, at: int) -> str:
    parameters = rows.at(at)
    axes = f", axes={plain(parameters.axes)!r}" if rows.shape.rotates and not _upright(rows.axes[at]) else ""
    return shown(parameters)[:-1].removesuffix(", ") + axes + ")"


def numbers_shown(values: Any) -> str:
    return repr(tuple(float(value) for value in values))


def _upright(axes: np.ndarray) -> bool:
    return bool((axes == np.eye(len(axes))).all())
