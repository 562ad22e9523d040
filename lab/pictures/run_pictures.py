"""The two pictures of a run: the final state and the paths."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_rgba_array

from ...components.part_of import PartOf
from ...drawing import Drawing, Lines, Style
from ...drawing.up import up_of
from ...systems.shapes.quaternions import axes_of
from ..measure.bodies import QUIET, Floats
from ..measure.paths import Traces
from ..measure.run import Run
from ..reporting.text import counted
from . import canvas
from .canvas import Sheet
from .figures import Figures
from .marks import draw_arrows, draw_bodies, draw_contacts, draw_joints, draw_paths, draw_walls
from .projection import Projection

CROWD_3D = 500  # untraced bodies that would hide the paths behind them
FEW, GHOSTS = 3, 14  # bodies up to which the shapes are repeated along the path, and how often
DRAWABLE = 1e30  # larger coordinates are not drawn
UNTRACED = "#1b2431"
HUGE = 5.0  # times the extent of everything smaller: such static bodies are clipped by the view


@dataclass(frozen=True)
class Still:
    """What is drawn of a moment."""

    shapes: Figures
    joints: Lines
    contacts: Lines  # from each point along its normal

    @classmethod
    def of(cls, drawing: Drawing) -> Still:
        """The present state of the world."""
        shown = drawing.update(contacts=True, interpolated=False)
        lines = (shown.lines_of(style) for style in (Style.JOINT, Style.NORMAL))
        return cls(Figures.of(drawing.world, shown), *lines)

    @property
    def moving(self) -> np.ndarray:
        """True for bodies that can be drawn as such."""
        return ~self.shapes.static & (np.abs(self.shapes.centre) < DRAWABLE).all(axis=1)


@QUIET
def draw_run(run: Run, out: Path, view: Any = None) -> list[Path]:
    """Draw ``run`` into the folder ``out``; returns the files. ``view``: two corners, None to choose them.

    An ``out`` that ends in .png is a file for the paths alone.
    """
    still = Still.of(Drawing(run.world))
    ends = find_view(still, run.traces) if view is None else view
    lower, upper = (np.asarray(end, float) for end in ends)
    projection = Projection.of(lower, upper, up_of(run.world))
    frame = projection.frame()
    if is_file(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        return [draw_traces(run, still, projection, frame).save(out)]
    stem = Path(run.report.scene).stem
    out.mkdir(parents=True, exist_ok=True)
    return [
        draw_final(run, still, projection, frame).save(out / f"{stem}-final.png"),
        draw_traces(run, still, projection, frame).save(out / f"{stem}-traces.png"),
    ]


def is_file(out: Path) -> bool:
    """True if it is the name of one picture, not of a folder."""
    return out.suffix.lower() == ".png"


def find_view(still: Still, traces: Traces) -> tuple[Floats, Floats]:
    """The region that holds all paths and static shapes; of huge shapes only the near part."""
    shapes, moving = still.shapes, still.shapes.where(still.moving)
    d = shapes.centre.shape[1]
    lows, highs = [moving.lower], [moving.upper]
    if traces.positions.size:
        points = traces.positions.reshape(-1, d)
        paths = points[np.isfinite(points).all(axis=1)].astype(float)
        size = (moving.upper - moving.lower).max(axis=0) / 2 if len(moving.entity) else np.zeros(d)
        lows.append(paths - size)
        highs.append(paths + size)
    low, high = np.concatenate(lows), np.concatenate(highs)
    if not len(low):
        smallest = np.argsort(shapes.extent, kind="stable")[:1]
        low, high = shapes.lower[smallest], shapes.upper[smallest]
    if not len(low):
        low, high = np.zeros((1, d)), np.ones((1, d))
    lower, upper = low.min(axis=0), high.max(axis=0)
    fixed = shapes.where(shapes.static & (np.abs(shapes.centre) < DRAWABLE).all(axis=1))
    for k in np.argsort(fixed.extent, kind="stable"):  # smallest first
        if fixed.extent[k] <= HUGE * float((upper - lower).max()):
            lower, upper = np.minimum(lower, fixed.lower[k]), np.maximum(upper, fixed.upper[k])
    room = 0.12 * max(float((upper - lower).max()), 1e-9)
    near_low, near_high = lower - 2 * room, upper + 2 * room
    close = fixed.where(np.all((fixed.upper >= near_low) & (fixed.lower <= near_high), axis=1))
    for box_low, box_high in zip(close.lower, close.upper, strict=True):
        lower = np.minimum(lower, np.maximum(box_low, near_low))
        upper = np.maximum(upper, np.minimum(box_high, near_high))
    return lower - room / 2, upper + room / 2


def draw_final(run: Run, still: Still, projection: Projection, frame: canvas.View) -> Sheet:
    """All shapes to scale, coloured by speed, with velocities and contacts."""
    report, shapes = run.report, still.shapes
    bodies = shapes.where(still.moving)
    norm = canvas.speed_norm(bodies.speed)
    kinds = [f"{report.bodies[kind]:,} {kind}" for kind in ("dynamic", "kinematic") if report.bodies[kind]]
    subtitle = (
        f"{' and '.join(kinds) or 'no moving'} bodies after {report.simulated_seconds:.4g} s "
        f"({counted(report.steps, 'step')})   ·   {counted(len(still.contacts), 'contact')}   ·   "
        f"{report.settings['integrator']}"
    )
    sheet = Sheet.new(report.scene, subtitle, frame, numbered=projection.flat)
    draw_walls(sheet, shapes.where(shapes.static), projection)
    draw_bodies(sheet, bodies, canvas.SPEED(norm(bodies.speed)), projection)
    draw_joints(sheet, still.joints, projection)
    points, ends = still.contacts.points[:, 0], still.contacts.points[:, 1]
    normals = (ends - points) / np.linalg.norm(ends - points, axis=1, keepdims=True)
    drawn = draw_contacts(sheet, points, normals, bodies.typical_diameter, projection)
    seconds = draw_arrows(sheet, bodies, projection, float(norm.vmax or 1.0))
    legend = [(r"$\rightarrow$", canvas.TEXT, f"the way in {seconds:.2g} s")] if seconds else []
    sheet.legend([*legend, *[("o", canvas.CONTACT, "contact")] * drawn])
    sheet.speed_scale(norm)
    return sheet


def draw_traces(run: Run, still: Still, projection: Projection, frame: canvas.View) -> Sheet:
    """The paths, one colour per body, fading with age; the traced bodies at their present positions."""
    traces, shapes, report = run.traces, still.shapes, run.report
    count, moved = len(traces.entities), traces.moved
    farthest = ", those that went farthest" * (count < moved)
    subtitle = f"paths of {count:,} of {counted(moved, 'body', 'bodies')} that moved{farthest}, over "
    subtitle += f"{counted(report.steps, 'step')}, {report.simulated_seconds:.4g} s, fading into the past"
    if traces.impacts is not None:
        subtitle += f"   ·   {report.settings['collision']}"
    sheet = Sheet.new(report.scene, subtitle, frame, numbered=projection.flat)
    draw_walls(sheet, shapes.where(shapes.static), projection)
    traced = np.isin(shapes.entity, traces.entities)
    others, followed = shapes.where(still.moving & ~traced), shapes.where(still.moving & traced)
    if projection.flat or len(others.entity) <= CROWD_3D:
        faint = np.tile(to_rgba_array(UNTRACED), (len(others.entity), 1))
        draw_bodies(sheet, others, faint, projection, zorder=2)
    palette = to_rgba_array(canvas.BODY_COLOURS)
    bodies = {entity: part.holder for entity, part in run.world.get_component(PartOf)}  # parts have their colours
    owners = np.array([bodies.get(entity, entity) for entity in traces.entities.tolist()], np.int64)
    numbers = np.searchsorted(traces.entities, owners)
    colours = palette[numbers * 5 % len(palette)]  # bodies with consecutive ids get different colours
    if count and len(traces.positions) > 1:
        draw_paths(sheet, traces.corners, colours, projection)
    own = colours[np.searchsorted(traces.entities, followed.entity)] if count else np.zeros((0, 4))
    if 0 < count <= FEW or (count and traces.impacts is not None):
        _draw_ghosts(sheet, traces, followed, own, projection)
    draw_bodies(sheet, followed, own, projection)
    draw_joints(sheet, still.joints, projection)
    if traces.impacts:
        points, normals = (np.array([getattr(one, name) for one in traces.impacts]) for name in ("point", "normal"))
        draw_contacts(sheet, points, normals, followed.typical_diameter, projection)
        sheet.legend([("o", canvas.CONTACT, "impact")])
    return sheet


def _draw_ghosts(sheet: Sheet, traces: Traces, followed: Figures, colours: Floats, projection: Projection) -> None:
    """The shapes at equal time intervals along the path."""
    positions = traces.positions
    when = np.unique(np.linspace(0, len(positions) - 1, GHOSTS).round().astype(int))[:-1]
    for row, entity in enumerate(followed.entity):
        body = np.searchsorted(traces.entities, entity)
        shown = when[np.isfinite(positions[when, body]).all(axis=1)]
        axes = axes_of(traces.rotations[:, body].astype(float), positions.shape[2])
        places, turns = positions[shown, body], axes[shown] @ axes[-1].T
        repeated = np.tile(colours[row], (len(places), 1))
        repeated[:, 3] = np.linspace(0.12, 0.4, len(places))
        draw_bodies(sheet, followed.where(np.array([row])).at(places, turns), repeated, projection, zorder=2.7)
