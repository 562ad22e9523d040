"""A run as a picture that moves: bodies to scale, coloured by speed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ...drawing import Drawing
from ...framework import World
from ..measure.bodies import QUIET
from ..measure.run import Run
from . import canvas
from .canvas import Sheet
from .marks import draw_bodies, draw_joints, draw_walls
from .projection import Projection
from .run_pictures import Still, find_view

KINDS = (".gif", ".webp")
RATE = 20  # frames per simulated second
MOST_FRAMES = 500  # of longer runs, farther apart
DPI = 50


class Recording:
    """Keeps what is drawn of every ``every``-th step of ``world``; :meth:`save` draws them."""

    def __init__(self, world: World, steps: int) -> None:
        dt = world.settings.dt
        self.drawing = Drawing(world)
        self.every = max(1, round(1 / (RATE * dt)), -(-steps // MOST_FRAMES))
        self.milliseconds = 1000 * self.every * dt
        self.frames: list[Still] = []
        self.after_step(0)

    def after_step(self, done: int) -> None:
        if done % self.every == 0:
            self.frames.append(Still.of(self.drawing))

    @QUIET
    def save(self, run: Run, file: Path, view: Any, drawn: Callable[[int], None]) -> Path:
        """Write ``file``; ``drawn`` is called with the number of frames done."""
        ends = find_view(Still.of(self.drawing), run.traces) if view is None else view
        projection = Projection.of(*(np.asarray(end, float) for end in ends))
        speeds = [still.shapes.speed[~still.shapes.static] for still in self.frames]
        norm = canvas.speed_norm(np.concatenate(speeds))
        images = []
        for still in self.frames:
            images.append(Image.fromarray(draw_frame(run.report.scene, still, projection, norm).pixels(DPI)))
            drawn(len(images))
        file.parent.mkdir(parents=True, exist_ok=True)
        if file.suffix.lower() == ".gif":
            some = np.vstack([np.asarray(image) for image in images[:: -(-len(images) // 8)]])
            palette = Image.fromarray(some).quantize(64)  # one for all, and no dithering: else still parts flicker
            images = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
        first, *others = images
        packing: dict[str, Any] = {"quality": 45, "kmin": 200, "kmax": 400}  # of WebP: still parts are kept once
        first.save(file, save_all=True, append_images=others, duration=round(self.milliseconds), loop=0, **packing)
        return file


def draw_frame(title: str, still: Still, projection: Projection, norm: Any) -> Sheet:
    """All shapes to scale, coloured by speed."""
    sheet = Sheet.new(title, "", projection.frame(), numbered=False)
    bodies = still.shapes.where(still.moving)
    draw_walls(sheet, still.shapes.where(still.shapes.static), projection)
    draw_bodies(sheet, bodies, canvas.SPEED(norm(bodies.speed)), projection)
    draw_joints(sheet, still.joints, projection)
    return sheet
