"""Subjects and findings of ``carom plugins check``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...framework.plugins.checks import plain, shown
from .samples import KINDS, Poses, Rows


@dataclass
class Finding:
    """One defect: what, an example input, and the cure; ``share``: fraction of the inputs it occurs for."""

    what: str
    example: str
    cure: str
    share: str = ""


@dataclass
class Subject:
    """A checked shape, pair or other function, in one dimension, with its findings."""

    kind: str
    name: str
    dimensions: int | None = None
    inputs: int = 0
    findings: list[Finding] = field(default_factory=list)
    note: str = ""

    @property
    def place(self) -> str:
        return f"{self.kind} {self.name}" + (f", {self.dimensions}D" if self.dimensions else "")

    def found(self, bad: np.ndarray, what: Any, example: Any, cure: str) -> bool:
        """Record a finding where ``bad`` (n,) is true; ``what`` and ``example`` describe the first such row."""
        at = np.flatnonzero(bad)
        if len(at):
            first = int(at[0])
            self.findings.append(Finding(what(first), example(first), cure, f"{len(at)} of {len(bad)}"))
        return len(at) > 0


@dataclass
class Report:
    """The findings for one plugin."""

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
    """The input of a pair function, as text."""
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
