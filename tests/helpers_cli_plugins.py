"""The ``carom`` command in an empty folder, a good plugin, and the plugins that ship with carom."""

from __future__ import annotations

import tomllib
from pathlib import Path

from helpers_cli import carom

__all__ = ["BALL", "OFFERED", "ROOT", "carom", "offer", "refusal", "row_of"]

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OFFERED = PROJECT["entry-points"]["carom.plugins"]

BALL = """
from carom.components import SphereCollider
from carom.components.colliders import Collider
from carom.framework import Plugin, column
from carom.framework.vectors import add, divided, length, scale
from carom.plugins.standard_sweeps import ball
import math

plugin = Plugin("balls", version="1.2")

@plugin.shape(cost=1.2)
class BallCollider(Collider):
    radius = column(minimum=0.0)
    def bounds(shape, dimensions):
        if dimensions == 2:
            return shape.radius, shape.radius
        return shape.radius, shape.radius, shape.radius
    def support(shape, direction):
        return scale(direction, 0.0)
    def rounding(shape):
        return shape.radius

@plugin.kernel
def along(d, distance):
    return divided(d, distance) if distance > 0.0 else add(scale(d, 0.0), unit(d))

@plugin.kernel
def unit(d):
    return (1.0, 0.0) if len(d) == 2 else (1.0, 0.0, 0.0)

@plugin.pair(BallCollider, SphereCollider)
def ball_sphere(a, b, d):
    distance = length(d)
    depth = a.radius + b.radius - distance
    normal = along(d, distance)
    return depth >= 0.0, depth, normal, scale(normal, a.radius - 0.5 * depth)

@plugin.pair(BallCollider, BallCollider)
def ball_ball(a, b, d):
    distance = length(d)
    depth = a.radius + b.radius - distance
    normal = along(d, distance)
    return depth >= 0.0, depth, normal, scale(normal, a.radius - 0.5 * depth)
"""


def row_of(output: str, start: str) -> str:
    return next(line for line in output.splitlines() if line.startswith(start))


def refusal(result) -> str:
    assert result.exit_code == 2, (result.stdout, result.stderr, result.exception)
    assert result.stdout == ""
    return result.stderr.strip()


def offer(folder: Path, name: str, points: dict[str, str], monkeypatch, version: str = "0.7") -> None:
    """Simulate an installed package that offers these."""
    info = folder / f"{name}-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    lines = "".join(f"{point} = {value}\n" for point, value in points.items())
    (info / "entry_points.txt").write_text(f"[carom.plugins]\n{lines}")
    monkeypatch.syspath_prepend(str(folder))
