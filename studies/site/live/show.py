"""One scene of the site, drawn on the canvas of its page: that behind the ? of the address."""

from __future__ import annotations

import importlib
import math
import warnings
from typing import Any

from carom import AABBCollider, BoxCollider, PhysicsWarning, SphereCollider, Transform

warnings.simplefilter("ignore", PhysicsWarning)  # the page would print them over the picture

COLOURS = ("#ffd43b", "#51cf66", "#4dabf7", "#ff8787", "#b197fc", "#22b8cf", "#ffa94d", "#a9e34b")
shown: list[Any] = []  # the scene's module and its world


def build(settings=None, seed=0):
    return importlib.import_module("pegs").build(settings, seed)


def scene() -> Any:
    """The module and its world; from the beginning when its time is over."""
    if not shown:
        from js import location  # of the browser  # pyright: ignore[reportMissingImports]

        shown[:] = importlib.import_module(str(location.search)[1:]), None
    seconds = getattr(shown[0], "SECONDS", getattr(shown[0], "seconds", 10.0))
    if shown[1] is None or shown[1].time > seconds:
        shown[1] = shown[0].build(None, 0)
    return shown


def frame(seconds: float) -> None:
    from js import document  # pyright: ignore[reportMissingImports]

    module, world = scene()
    world.advance(seconds)
    canvas = document.getElementById("canvas")
    draw = canvas.getContext("2d")
    (left, bottom), (right, top) = getattr(module, "VIEW", None) or module.view
    scale = min(canvas.width / (right - left), canvas.height / (top - bottom))
    draw.resetTransform()
    draw.clearRect(0, 0, canvas.width, canvas.height)
    middle = canvas.width / 2 - scale * (left + right) / 2, canvas.height / 2 + scale * (bottom + top) / 2
    bodies = world.bodies
    row_of = {int(entity): k for k, entity in enumerate(bodies.entity)}
    static = set(map(int, bodies.static.entity))
    places, angles = bodies.interpolated_position, bodies.interpolated_rotation
    for shape in (AABBCollider, BoxCollider, SphereCollider):
        for entity, (_, collider) in world.get_components(Transform, shape):
            x, y = places[row_of[entity]]
            draw.setTransform(scale, 0, 0, -scale, middle[0] + scale * float(x), middle[1] - scale * float(y))
            draw.rotate(float(angles[row_of[entity]]))
            draw.fillStyle = "#4b5563" if entity in static else COLOURS[entity % len(COLOURS)]
            if shape is SphereCollider:
                draw.beginPath()
                draw.arc(0, 0, collider.radius, 0, 2 * math.pi)
                draw.fill()
            else:
                width, height = (float(half) for half in collider.half_extents)
                draw.fillRect(-width, -height, 2 * width, 2 * height)
