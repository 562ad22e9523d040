"""Painting a drawing list in 3D with moderngl: shaded solids, off-screen, copied onto a surface."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...drawing import DrawingList
from ...framework import CaromError
from ..colours import BACKGROUND, FILLS, FILLS_MARKED
from ..packages import package
from .orbit import OrbitCamera
from .solids import PLAIN, ball, ends, rounds, triangles

DETAIL = ((150, 3), (700, 2), (6000, 1), (np.inf, 0))  # up to so many balls, how often their faces are divided
SAMPLES = 4  # for smooth edges, but where the processor draws
SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swiftshader")
PANE = 0.13  # how opaque static faces are that hide what is looked at

_LIGHT = """
    uniform vec3 eye; uniform vec3 up;
    vec3 lit(vec3 colour, vec3 normal, vec3 place) {
        vec3 towards = normalize(eye - place);
        float sun = max(dot(normal, normalize(up + vec3(0.3, 0.2, 0.1) + towards)), 0.0);
        return colour * (0.42 + 0.7 * sun);
    }
"""
FACES = (
    """
    #version 330
    uniform mat4 matrix;
    in vec3 place; in vec3 normal; in vec4 colour;
    out vec3 at; flat out vec3 aside; flat out vec4 fill;
    void main() { at = place; aside = normal; fill = colour; gl_Position = matrix * vec4(place, 1.0); }
    """,
    "#version 330\n"
    + _LIGHT
    + """
    uniform vec3 middle;   // what is looked at
    uniform float pane;    // how opaque a face is that hides it; 1: as any
    uniform bool glass;    // whether what is not opaque is drawn, or what is
    in vec3 at; flat in vec3 aside; flat in vec4 fill;
    out vec4 shown;
    void main() {
        float opaque = fill.a < 0.9 ? fill.a : dot(aside, middle - at) < 0.0 ? pane : 1.0;
        if (glass != (opaque < 1.0)) discard;
        shown = vec4(lit(fill.rgb, aside, at), opaque);
    }
    """,
)
ROUNDS = (
    """
    #version 330
    uniform mat4 matrix;
    in vec3 corner; in vec3 one; in vec3 other; in float radius; in mat3 axes; in vec4 colour;
    out vec3 at; out vec3 aside; out vec3 own; flat out vec4 fill;
    void main() {
        mat3 turned = transpose(axes);  // rows of numpy
        aside = turned * corner; own = corner; fill = colour;
        at = (corner.z > 0.0 ? other : one) + radius * aside;
        gl_Position = matrix * vec4(at, 1.0);
    }
    """,
    "#version 330\n"
    + _LIGHT
    + """
    in vec3 at; in vec3 aside; in vec3 own; flat in vec4 fill;
    out vec4 shown;
    void main() {
        bool mark = fill.a > 0.998 && own.x * own.y * own.z > 0.0;  // octants, by turns
        shown = vec4(lit(mark ? fill.rgb * 0.6 : fill.rgb, normalize(aside), at), fill.a < 0.9 ? fill.a : 1.0);
    }
    """,
)
ENDS = (
    """
    #version 330
    uniform mat4 matrix;
    in vec3 place; in vec4 colour;
    out vec4 fill;
    void main() { fill = colour; gl_Position = matrix * vec4(place, 1.0); gl_PointSize = 5.0; }
    """,
    """
    #version 330
    in vec4 fill; out vec4 shown;
    void main() { shown = vec4(fill.rgb, 1.0); }
    """,
)


class GraphicsError(CaromError):
    """There is no OpenGL 3.3, neither by a driver nor in software."""


def context_of(moderngl: Any) -> Any:
    """A context that no window has; GraphicsError if none can be made."""
    reasons = []
    for options in ({}, {"backend": "egl"}):  # the second needs no display
        try:
            return moderngl.create_standalone_context(require=330, **options)
        except Exception as error:  # glcontext raises plain ones
            reasons.append(str(error))
    raise GraphicsError(f"worlds in 3D are drawn by OpenGL 3.3, and there is none: {'; '.join(reasons)}")


class SpacePainter:
    """Paints what a ``Drawing`` lists, as :class:`Painter` does in 2D."""

    def __init__(self) -> None:
        self._pygame = package("pygame", "carom.view")
        self._gl: Any = package("moderngl", "a view in 3D")
        self._context = context = context_of(self._gl)
        self._faces = context.program(vertex_shader=FACES[0], fragment_shader=FACES[1])
        self._rounds = context.program(vertex_shader=ROUNDS[0], fragment_shader=ROUNDS[1])
        self._ends = context.program(vertex_shader=ENDS[0], fragment_shader=ENDS[1])
        self._balls = [(most, context.buffer(ball(times))) for most, times in DETAIL]
        self._target: Any = None
        self._fixed: Any = None
        self._fixed_of: Any = None
        self._fills: Any = FILLS

    def show_sleepers(self, marked: bool) -> None:
        """Whether sleepers have a colour of their own."""
        self._fills = FILLS_MARKED if marked else FILLS

    def paint(self, surface: Any, shown: DrawingList, camera: OrbitCamera, ground: bool = True) -> None:
        """Paint all of ``shown`` as ``camera`` sees it, over all of the ``surface``, also without ``ground``."""
        context, gl = self._context, self._gl
        frame, resolved = self._frame(surface.get_size())
        frame.use()
        frame.clear(*(part / 255 for part in BACKGROUND), depth=1.0)
        context.enable(gl.DEPTH_TEST | gl.CULL_FACE | gl.BLEND)
        context.blend_func = gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA
        matrix = np.ascontiguousarray(camera.matrix().T, np.float32)
        for program in (self._faces, self._rounds, self._ends):
            program["matrix"].write(matrix)
        for program in (self._faces, self._rounds):
            program["eye"].write(camera.place.astype(np.float32))
            program["up"].write(camera.up.astype(np.float32))
        self._faces["middle"].write(camera.middle.astype(np.float32))
        if shown.fixed is not self._fixed_of:
            self._fixed = triangles(shown.fixed), rounds(shown.fixed_circles, shown.fixed_capsules)
            self._fixed_of = shown.fixed
        moving = rounds(shown.circles, shown.capsules, self._fills)
        faces, (fixed_faces, fixed_rounds) = triangles(shown.polygons, self._fills), self._fixed
        every = np.concatenate((moving, fixed_rounds))
        clear = every["colour"][:, 3] < PLAIN
        for glass in (False, True):  # what is not opaque comes last, and hides nothing
            frame.depth_mask = not glass
            self._faces["glass"].value = glass
            self._faces["pane"].value = 1.0
            self._draw_faces(faces)
            self._faces["pane"].value = PANE
            self._draw_faces(fixed_faces)
            self._draw_rounds(every[clear == glass])
            if not glass:
                self._draw_ends(ends((*shown.lines, *shown.fixed_lines)), gl.LINES)
                self._draw_dots(shown)
        frame.depth_mask = True
        context.copy_framebuffer(resolved, frame)
        pixels = resolved.read(components=3, alignment=1)
        image = self._pygame.image.frombuffer(pixels, surface.get_size(), "RGB")
        surface.blit(self._pygame.transform.flip(image, False, True), (0, 0))

    def _frame(self, size: Any) -> Any:
        if self._target is None or self._target[0].size != size:
            context = self._context
            for old in self._target or ():
                old.release()
            slow = any(name in context.info["GL_RENDERER"].lower() for name in SOFTWARE)
            samples = 0 if slow else min(SAMPLES, context.max_samples)
            colour = context.renderbuffer(size, 3, samples=samples)
            depth = context.depth_renderbuffer(size, samples=samples)
            self._target = (
                context.framebuffer([colour], depth),
                context.framebuffer([context.renderbuffer(size, 3)]),
            )
        return self._target

    def _draw(self, program: Any, mode: int, count: int, instances: int, *parts: Any) -> None:
        array = self._context.vertex_array(program, list(parts))
        array.render(mode, vertices=count, instances=instances)
        array.release()

    def _draw_faces(self, corners: Any) -> None:
        if len(corners):
            data = self._context.buffer(corners)
            parts = (data, "3f 3f 4f1", "place", "normal", "colour")
            self._draw(self._faces, self._gl.TRIANGLES, len(corners), 1, parts)
            data.release()

    def _draw_rounds(self, some: Any) -> None:
        if len(some):
            data = self._context.buffer(some)
            corners = next(corners for most, corners in self._balls if len(some) <= most)
            parts = (data, "3f 3f 1f 9f 4f1/i", "one", "other", "radius", "axes", "colour")
            count = corners.size // 12
            self._draw(self._rounds, self._gl.TRIANGLES, count, len(some), (corners, "3f", "corner"), parts)
            data.release()

    def _draw_ends(self, places: Any, mode: int) -> None:
        if len(places):
            data = self._context.buffer(places)
            self._draw(self._ends, mode, len(places), 1, (data, "3f 4f1", "place", "colour"))
            data.release()

    def _draw_dots(self, shown: DrawingList) -> None:
        for points in shown.points:
            self._context.enable(self._gl.PROGRAM_POINT_SIZE)
            doubled = ends([_as_lines(points)])[::2]
            self._draw_ends(np.ascontiguousarray(doubled), self._gl.POINTS)

    def release(self) -> None:
        """Give everything back to the driver."""
        self._context.release()


def _as_lines(points: Any) -> Any:
    """Lines without length, for their colours."""
    from ...drawing import Lines

    return Lines(np.stack((points.points, points.points), axis=1), points.style, points.entity)
