"""Painting a drawing list in 2D into a window of pyglet, and so of arcade: a few calls, whatever there is."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from ...drawing import DrawingList
from ..camera import Camera
from ..colours import BACKGROUND, FILLS, FILLS_MARKED
from ..packages import package
from .triangles import CORNER, disc_corners, dot_corners, line_ends, polygon_corners, polygon_edges

DOT = 3.0  # pixels, the radius of a point

VERTEX = """
    #version 330 core
    in vec2 place; in vec2 local; in vec4 fill; in vec4 edge;
    uniform vec4 area;  // middle, and half of what is seen
    out vec2 own; flat out vec4 inner; flat out vec4 outer;
    void main() { own = local; inner = fill; outer = edge; gl_Position = vec4((place - area.xy) / area.zw, 0.0, 1.0); }
"""
FRAGMENT = """
    #version 330 core
    in vec2 own; flat in vec4 inner; flat in vec4 outer;
    out vec4 shown;
    void main() {
        float away = length(own), pixel = fwidth(own.x) + 1e-9;
        if (away > 1.0) discard;
        bool mark = outer.a < 0.998 && own.x > 0.0 && abs(own.y) < pixel && pixel < 0.3;
        shown = mark || (away > 1.0 - pixel && pixel < 0.3) ? vec4(outer.rgb, 1.0) : inner;
    }
"""
PARTS = (("place", 2, "f"), ("local", 2, "f"), ("fill", 4, "B"), ("edge", 4, "B"))


class PygletPainter:
    """Paints into the OpenGL context that is current when it is made: a window of pyglet or arcade, which has to be
    open. The camera counts pixels as it likes.
    """

    def __init__(self) -> None:
        gl = self._gl = package("pyglet", "carom.view.PygletPainter", "gl")
        shader = package("pyglet", "carom.view.PygletPainter", "graphics.shader")
        self._program = shader.ShaderProgram(shader.Shader(VERTEX, "vertex"), shader.Shader(FRAGMENT, "fragment"))
        self._array, self._buffer = gl.GLuint(), gl.GLuint()
        gl.glGenVertexArrays(1, self._array)
        gl.glGenBuffers(1, self._buffer)
        gl.glBindVertexArray(self._array)
        gl.glBindBuffer(gl.GL_ARRAY_BUFFER, self._buffer)
        for name, count, kind in PARTS:
            place = self._program.attributes[name]["location"]
            number, whole = (gl.GL_FLOAT, gl.GL_FALSE) if kind == "f" else (gl.GL_UNSIGNED_BYTE, gl.GL_TRUE)
            start = ctypes.c_void_p(CORNER.fields[name][1])  # type: ignore[index]
            gl.glEnableVertexAttribArray(place)
            gl.glVertexAttribPointer(place, count, number, whole, CORNER.itemsize, start)
        gl.glBindVertexArray(0)
        self._fills = FILLS
        self._fixed: Any = None
        self._fixed_of: Any = None

    def show_sleepers(self, marked: bool) -> None:
        """Whether sleepers have a colour of their own."""
        self._fills = FILLS_MARKED if marked else FILLS

    def paint(self, shown: DrawingList, camera: Camera, ground: bool = True) -> None:
        """Paint all of ``shown`` as ``camera`` sees it; ``ground``: on a background."""
        gl, fills = self._gl, self._fills
        if ground:
            gl.glClearColor(*(part / 255 for part in BACKGROUND), 1.0)
            gl.glClear(gl.GL_COLOR_BUFFER_BIT)
        if shown.fixed is not self._fixed_of:
            self._fixed = (
                np.concatenate((polygon_corners(shown.fixed), disc_corners(shown.fixed_circles))),
                np.concatenate((polygon_edges(shown.fixed), line_ends(shown.fixed_lines))),
            )
            self._fixed_of = shown.fixed
        self._program.use()
        half = np.array(camera.size) / (2 * camera.scale)
        self._program["area"] = (*camera.middle.tolist(), *half.tolist())
        gl.glEnable(gl.GL_BLEND)
        gl.glBlendFunc(gl.GL_SRC_ALPHA, gl.GL_ONE_MINUS_SRC_ALPHA)
        faces, edges = self._fixed
        self._draw(gl.GL_TRIANGLES, faces)
        self._draw(gl.GL_LINES, edges)
        self._draw(gl.GL_TRIANGLES, polygon_corners(shown.polygons, fills))
        self._draw(gl.GL_LINES, polygon_edges(shown.polygons, fills))
        self._draw(gl.GL_TRIANGLES, disc_corners(shown.circles, fills))
        self._draw(gl.GL_LINES, line_ends(shown.lines, fills))
        self._draw(gl.GL_TRIANGLES, dot_corners(shown.points, DOT / camera.scale, fills))
        self._program.stop()

    def _draw(self, mode: int, corners: Any) -> None:
        if not len(corners):
            return
        gl = self._gl
        gl.glBindVertexArray(self._array)
        gl.glBindBuffer(gl.GL_ARRAY_BUFFER, self._buffer)
        data = corners.ctypes.data_as(ctypes.c_void_p)
        gl.glBufferData(gl.GL_ARRAY_BUFFER, corners.nbytes, data, gl.GL_STREAM_DRAW)
        gl.glDrawArrays(mode, 0, len(corners))
        gl.glBindVertexArray(0)
