"""Films: GIF and WebP by pillow, MP4 by imageio-ffmpeg, of surfaces or of worlds that no window shows."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..drawing import Drawing
from ..framework import CaromError, World
from ..framework.typing import Vector
from .camera import corners_of
from .choice import camera_of, painter_of
from .packages import package

RATES = {".mp4": 30, ".gif": 20, ".webp": 20}  # frames per second
KINDS = tuple(RATES)
WIDEST = {".mp4": 1920, ".gif": 800, ".webp": 800}  # pixels; wider surfaces are made smaller
SIZES = {".mp4": (1280, 720), ".gif": (800, 450), ".webp": (800, 450)}  # of films without a window
MOST_FRAMES = 600  # of GIF and WebP; of longer ones every second goes, and so on
LONGEST_FRAME = 1.0  # s: a window that stood still for longer is not filmed for so long
COLOURS = 96  # of a GIF


class Film:
    """A file that frames are added to; the first one decides its size.

    CaromError for a name that ends in none of .mp4, .gif and .webp, or a folder that cannot be written;
    MissingPackageError if the package that writes it is missing.
    """

    def __init__(self, path: Path) -> None:
        self.kind = path.suffix.lower()
        if self.kind not in RATES:
            raise CaromError(f"a film has a name that ends in {', '.join(RATES)}, not {path}")
        self.path, self.rate = path, RATES[self.kind]
        self._pygame = package("pygame", "a film")
        self._pillow = None if self.kind == ".mp4" else package("PIL", f"a film in {self.kind}", "Image")
        self._ffmpeg = package("imageio_ffmpeg", "a film in .mp4") if self.kind == ".mp4" else None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise CaromError(f"film {path}: {error.strerror or error}") from error
        if path.is_dir() or not os.access(path.parent, os.W_OK | os.X_OK):
            raise CaromError(f"film {path}: it cannot be written there")
        self.frames = 0
        self._size: Any = None
        self._writer: Any = None  # of MP4
        self._kept: list[bytes] = []  # of the others, compressed
        self._every = 1  # which frames are kept
        self._due = 1.0  # frames

    def add(self, surface: Any, seconds: float) -> None:
        """Show a pygame.Surface; ``seconds`` have passed since the last one, as many frames are added."""
        if self._size is not None:
            self._due += min(seconds, LONGEST_FRAME) * self.rate
        count = int(self._due + 1e-6)
        self._due -= count
        if not count:
            return
        pixels = self._pixels(surface)
        for _ in range(count):
            self._add(pixels)

    def _pixels(self, surface: Any) -> bytes:
        width, height = surface.get_size()
        if self._size is None:
            factor = min(1.0, WIDEST[self.kind] / width)
            self._size = max(2, round(width * factor) // 2 * 2), max(2, round(height * factor) // 2 * 2)
        if surface.get_size() != self._size:
            surface = self._pygame.transform.smoothscale(surface.convert(24), self._size)
        return self._pygame.image.tobytes(surface, "RGB")

    def _add(self, pixels: bytes) -> None:
        self.frames += 1
        if self._ffmpeg is not None:
            if self._writer is None:
                self._writer = self._ffmpeg.write_frames(
                    str(self.path), self._size, fps=self.rate, macro_block_size=2, ffmpeg_log_level="error", quality=7
                )
                self._writer.send(None)
            self._writer.send(pixels)
            return
        if (self.frames - 1) % self._every:
            return
        self._kept.append(zlib.compress(pixels, 1))
        if len(self._kept) > MOST_FRAMES:
            self._kept = self._kept[::2]
            self._every *= 2

    def close(self) -> None:
        """Write what is kept; CaromError if the disk refuses it."""
        try:
            if self._writer is not None:
                self._writer.close()
            elif self._kept:
                self._save()
        except OSError as error:
            raise CaromError(f"film {self.path}: {error.strerror or error}") from error
        self._writer, self._kept = None, []

    def _save(self) -> None:
        image: Any = self._pillow
        palette = None
        if self.kind == ".gif":  # one palette for all, and no dithering: else still parts flicker
            width, height = self._size
            some = [zlib.decompress(pixels) for pixels in self._kept[:: -(-len(self._kept) // 8)]]
            sample = image.frombytes("RGB", (width, height * len(some)), b"".join(some))
            palette = sample.quantize(COLOURS, dither=image.Dither.NONE)

        def images() -> Iterator[Any]:
            for pixels in self._kept:
                made = image.frombytes("RGB", self._size, zlib.decompress(pixels))
                yield made if palette is None else made.quantize(palette=palette, dither=image.Dither.NONE)

        frames = images()
        packing: dict[str, Any] = {"quality": 45, "kmin": 200, "kmax": 400}  # of WebP: still parts are kept once
        duration = round(1000 * self._every / self.rate)
        next(frames).save(self.path, save_all=True, append_images=frames, duration=duration, loop=0, **packing)


class Recording:
    """A film of a world that no window shows; :meth:`after_step` paints what is due.

    view
        (lower corner, upper corner), m, of what is shown; None: all there is
    above
        is called with the recording, to paint on its ``screen`` what is before the world
    """

    def __init__(
        self, world: World, path: Path, view: tuple[Vector, Vector] | None = None,
        above: Callable[[Any], object] | None = None,
    ) -> None:  # fmt: skip
        self.film = Film(path)
        self._world, self._drawing, self._painter = world, Drawing(world), painter_of(world)
        self.camera: Any = camera_of(world, SIZES[self.film.kind])
        view = view or corners_of(self._drawing.update(), np.asarray(world.bodies.position))
        if view is not None:
            self.camera.fit(*view)
        self.screen = package("pygame", "a film").Surface(self.camera.size)
        self._shown, self._above = 0, above
        self._show(0.0)

    def after_step(self, done: int) -> None:
        """To be called with the number of steps after each."""
        dt = self._world.settings.dt
        if (done - self._shown) * dt * self.film.rate >= 1.0 - 1e-6:
            self._show((done - self._shown) * dt)
            self._shown = done

    def close(self) -> None:
        """Write the film."""
        self.film.close()

    def _show(self, seconds: float) -> None:
        self._painter.paint(self.screen, self._drawing.update(interpolated=False), self.camera)
        if self._above is not None:
            self._above(self)
        self.film.add(self.screen, seconds)
