"""A window on a world in 2D, with pyglet: what :class:`View` is with pygame-ce, without panel, sprites and films."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..drawing import DrawingList
from ..framework import CaromError, World
from ..framework.typing import Vector
from .camera import Camera
from .colours import ACCENT, BACKGROUND
from .packages import MissingPackageError, package
from .plane.pyglet_painter import PygletPainter
from .window import LONGEST, DisplayError, Window

NAMES = {
    "MINUS": "-", "NUM_SUBTRACT": "-", "PLUS": "+", "EQUAL": "=", "NUM_ADD": "+", "PERIOD": ".", "NUM_DECIMAL": ".",
    "_0": "0", "NUM_0": "0",
}  # fmt: skip
SIZE = 11  # of letters


class PygletView(Window):
    """A window on a ``world`` in 2D with pyglet, for tens of thousands of shapes::

        PygletView(world).run()

    size, camera, title, controls, outlines, rate, rewind_megabytes, prepare, real_time
        as of :class:`View`; a camera of one's own counts pixels from above

    Keys and mouse are those of :class:`View`, but for the panel. ``view.window`` is pyglet's, ``view.keys`` the symbols
    that are held. CaromError for worlds in 3D, DisplayError without a display, MissingPackageError without
    pyglet.
    """

    def __init__(
        self,
        world: World,
        size: Vector = (1280, 720),
        *,
        camera: Camera | None = None,
        title: str = "carom",
        controls: bool = True,
        outlines: bool = True,
        rate: float = 60.0,
        rewind_megabytes: float = 100.0,
        prepare: bool = True,
        real_time: bool = True,
    ) -> None:
        self._pyglet = package("pyglet", "carom.view.PygletView")
        self._symbols = self._displayed(lambda: package("pyglet", "carom.view.PygletView", "window").key)
        super().__init__(world, size, camera, title, controls, outlines, rate, rewind_megabytes, prepare, real_time)
        if world.dimensions != 2:
            raise CaromError(f"PygletView shows worlds in 2D, {world!r} has {world.dimensions} dimensions")
        self.window: Any = self._opened(title)
        self.keys: set[int] = set()
        self._painter = PygletPainter()
        self._labels: dict[tuple[str, Any], Any] = {}
        self._last = time.perf_counter()
        self._fps = self.rate
        self.window.push_handlers(
            on_close=self._on_close, on_resize=self._on_resize, on_key_press=self._on_key_press,
            on_key_release=lambda symbol, modifiers: self.keys.discard(symbol), on_mouse_motion=self._on_motion,
            on_mouse_drag=self._on_drag, on_mouse_press=self._on_press, on_mouse_release=self._on_release,
            on_mouse_scroll=self._on_scroll,
        )  # fmt: skip

    def _opened(self, title: str) -> Any:
        width, height = self.camera.size
        make = self._pyglet.window.Window
        return self._displayed(lambda: make(width, height, caption=title, resizable=True, vsync=False))

    @staticmethod
    def _displayed(make: Callable[[], Any]) -> Any:
        """What ``make`` returns; the import of pyglet.window already looks for a display."""
        try:
            return make()
        except MissingPackageError:
            raise
        except Exception as error:  # pyglet's own of each platform have no common base
            raise DisplayError(
                f"no display for a window: {error}; carom run SCENE --record FILE draws without one"
            ) from error

    def _shut(self) -> None:
        if self.window is not None:
            self.window.close()
            self.window = None

    def _tick(self) -> float:
        if not self.real_time:
            return 1.0 / self.rate
        rest = self._last + 1.0 / self.rate - time.perf_counter()
        if rest > 0:
            time.sleep(rest)
        now = time.perf_counter()
        passed, self._last = now - self._last, now
        self._fps += 0.05 * (1.0 / max(passed, 1e-6) - self._fps)
        return min(passed, LONGEST)

    # -- keys and mouse ---------------------------------------------------------------------------

    def _hear(self) -> None:
        self.window.switch_to()
        self.window.dispatch_events()

    def _hear_close(self) -> None:
        controls, self.controls = self.controls, False
        self._hear()
        if self._symbols.ESCAPE in self.keys:
            self.open = False
        self.controls = controls

    def _on_close(self) -> bool:
        self.open = False
        return True  # pyglet's own would close it while it is drawn

    def _on_resize(self, width: int, height: int) -> None:
        self.camera.size = width, height

    def _on_key_press(self, symbol: int, modifiers: int) -> bool:
        self.keys.add(symbol)
        name = self._symbols.symbol_string(symbol) or ""
        self._key(NAMES.get(name, name.lower()), bool(modifiers & self._symbols.MOD_SHIFT))
        return True  # pyglet's own closes at escape

    def _on_motion(self, x: float, y: float, dx: float, dy: float) -> None:
        self._at = x, self.camera.size[1] - y

    def _on_drag(self, x: float, y: float, dx: float, dy: float, buttons: int, modifiers: int) -> None:
        self._on_motion(x, y, dx, dy)
        if self.controls:
            self._moved((dx, -dy), bool(buttons & 2), bool(buttons & 4))

    def _on_press(self, x: float, y: float, button: int, modifiers: int) -> None:
        self._on_motion(x, y, 0, 0)
        if self.controls and button == 1:
            self._pressed()

    def _on_release(self, x: float, y: float, button: int, modifiers: int) -> None:
        if self.controls and button == 1:
            self._released()

    def _on_scroll(self, x: float, y: float, scroll_x: float, scroll_y: float) -> None:
        if self.controls:
            self._scrolled(scroll_y)

    def _arrows(self) -> tuple[int, int]:
        held, keys = self.keys, self._symbols
        return int(keys.RIGHT in held) - int(keys.LEFT in held), int(keys.DOWN in held) - int(keys.UP in held)

    # -- drawing ----------------------------------------------------------------------------------

    def _paint(self, shown: DrawingList) -> None:
        self.window.switch_to()
        self._painter.show_sleepers(self.show["sleepers"])
        if self.show["outlines"]:
            self._painter.paint(shown, self.camera)
        else:
            self._clear()
        at = self._picked_pixels()
        if at is not None:
            height = self.camera.size[1]
            self._pyglet.shapes.Arc(at[0], height - at[1], 9, color=ACCENT).draw()
        for word in self._words(self._fps):
            self._write(*word)
        for table in self._tables():
            self._write_table(*table)
        self.window.flip()

    def _clear(self) -> None:
        gl = self._pyglet.gl
        gl.glClearColor(*(part / 255 for part in BACKGROUND), 1.0)
        gl.glClear(gl.GL_COLOR_BUFFER_BIT)

    def _write(self, text: str, place: Any, colour: Any) -> None:
        label = self._labels.get((text, colour))
        if label is None:
            if len(self._labels) > 1000:
                self._labels.clear()
            label = self._labels[text, colour] = self._pyglet.text.Label(
                text, font_size=SIZE, color=(*colour, 255), anchor_y="top"
            )
        label.x, label.y = place[0], self.camera.size[1] - place[1]
        label.draw()

    def _write_table(self, rows: Any, place: Any, widths: Any) -> None:
        height = 18 * len(rows) + 16
        ground = self._pyglet.shapes.Rectangle(
            place[0], self.camera.size[1] - place[1] - height, sum(widths) + 20, height, color=(16, 18, 24, 225)
        )
        ground.draw()
        for k, row in enumerate(rows):
            lefts = np.cumsum((place[0] + 10, *widths[:-1])).tolist()
            for text, left in zip(row, lefts, strict=True):
                self._write(text, (left, place[1] + 8 + 18 * k), (214, 219, 228))

    def _paint_progress(self, text: str, share: float) -> None:
        self.window.switch_to()
        self._clear()
        width, height = self.camera.size
        self._pyglet.shapes.Rectangle(width // 4, height // 2, share * width / 2, 4, color=ACCENT).draw()
        self._write(text, (width // 4, height // 2 - 30), (214, 219, 228))
        self.window.flip()

    def _save_picture(self) -> None:
        name = next(name for k in range(10_000) if not Path(name := f"carom-{k}.png").exists())
        try:
            self._pyglet.image.get_buffer_manager().get_color_buffer().save(name)
            self.say(f"saved as {Path(name).resolve()}")
        except OSError as error:
            self.say(f"{name}: {error}")
