"""A window on a world, with pygame-ce."""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ..drawing import DrawingList
from ..framework import World
from ..framework.typing import Vector
from .camera import Camera
from .choice import painter_of
from .colours import ACCENT, BACKGROUND, DIM
from .film import Film
from .packages import package
from .space.orbit import OrbitCamera
from .sprites import Sprites
from .tools.panel import Panel
from .tools.texts import Texts
from .window import LONGEST, DisplayError, Window

_owner: weakref.ref[View] | None = None  # which view has pygame's only window
NAMED = {"[-]": "-", "[+]": "+", "[0]": "0", "[.]": "."}  # keys of the number pad


class View(Window):
    """A window on a world, until it is closed::

        View(world).run()

    or in a loop of one's own, which gets the seconds since the last frame, 0 while time stands::

        view = View(world)
        for seconds in view:
            if view.keys[pygame.K_LEFT]: ...
            world.advance(seconds)

    size
        (width, height), pixels, at first
    sprites
        :class:`Sprites` to draw; several as a list
    camera
        a :class:`Camera`, in 3D an :class:`OrbitCamera`, of one's own; None: one that shows everything at first
    title
        of the window
    controls
        whether keys and mouse are the view's tools: F1 lists them. False: they are the game's alone, but for F1 and
        F10, which turns the tools on and off
    outlines
        whether the shapes of colliders are drawn
    rate
        frames per second, at most
    record
        a file that ends in .mp4, .gif or .webp, into which the window is filmed
    rewind_megabytes
        what snapshots for going back in time may take; 0: none are taken
    below, above
        functions that are called with the view, to paint on ``view.screen`` what is behind the world, and what is
        before it, on an empty ground
    prepare
        whether to compile before the first frame what the world may need, while the window hears keys
    real_time
        False: each frame is 1 / rate seconds, however long it takes, and nothing waits; for tests and films

    DisplayError without a display, MissingPackageError without pygame-ce. ``view.screen`` is the pygame.Surface,
    ``view.events`` this frame's pygame events, ``view.keys`` what is held, ``view.mouse`` the place, (d,) m, under the
    mouse; ``paused``, ``speed`` and ``picked`` can be set.
    """

    def __init__(
        self,
        world: World,
        size: Vector = (1280, 720),
        *,
        sprites: Any = None,
        camera: Camera | OrbitCamera | None = None,
        title: str = "carom",
        controls: bool = True,
        outlines: bool = True,
        rate: float = 60.0,
        record: str | os.PathLike[str] | None = None,
        rewind_megabytes: float = 100.0,
        below: Callable[[Any], object] | None = None,
        above: Callable[[Any], object] | None = None,
        prepare: bool = True,
        real_time: bool = True,
    ) -> None:
        self._pygame = pygame = package("pygame", "carom.view.View")
        super().__init__(world, size, camera, title, controls, outlines, rate, rewind_megabytes, prepare, real_time)
        self.below, self.above = below, above
        self.sprites: list[Sprites] = [sprites] if isinstance(sprites, Sprites) else list(sprites or ())
        self._film = None if record is None else Film(Path(record))
        self._painter = painter_of(world)
        self.screen = self._opened(self.camera.size, title)
        self.clock = pygame.time.Clock()
        self.keys, self.events = pygame.key.get_pressed(), []
        self._at = pygame.mouse.get_pos()
        self._texts = Texts(pygame)
        self._panel = Panel(pygame, self._texts.write)
        self._painted = False

    def _opened(self, size: Any, title: str) -> Any:
        pygame = self._pygame
        os.environ.setdefault("SDL_FRAMEBUFFER_ACCELERATION", "0")  # else a frame is drawn by OpenGL, also in software
        try:
            pygame.display.init()  # not pygame.init(): that opens the sound card, too
            driver = pygame.display.get_driver()
            if driver == "offscreen" and os.environ.get("SDL_VIDEODRIVER") != driver:  # SDL's last resort
                pygame.display.quit()
                raise pygame.error("no screen was found")
            screen = pygame.display.set_mode(size, pygame.RESIZABLE)
        except pygame.error as error:
            raise DisplayError(
                f"no display for a window: {error}; carom run SCENE --record FILE draws without one"
            ) from error
        global _owner
        _owner = weakref.ref(self)
        pygame.display.set_caption(title)
        pygame.key.set_repeat(300, 40)
        return screen

    def __iter__(self) -> Iterator[float]:
        try:
            yield from super().__iter__()
        except self._pygame.error as error:
            if self._pygame.display.get_init():
                raise DisplayError(f"the display has gone: {error}") from error

    def _shut(self) -> None:
        global _owner
        if _owner is not None and _owner() is self:
            _owner = None
            self._pygame.display.quit()

    def close(self) -> None:
        """Close the window and end the film; twice is fine."""
        super().close()
        film, self._film = self._film, None
        if film is not None:
            film.close()

    def _tick(self) -> float:
        if not self.real_time:
            self.clock.tick()
            return 1.0 / self.rate
        return min(self.clock.tick(self.rate) / 1000.0, LONGEST)

    # -- keys and mouse ---------------------------------------------------------------------------

    def _hear(self) -> None:
        self.open = _owner is not None and _owner() is self
        if not self.open:  # a later view has taken the window
            return
        self.events = self._pygame.event.get()
        for event in self.events:
            self._handle(event)
            if not self.open:
                return
        self.keys = self._pygame.key.get_pressed()

    def _hear_close(self) -> None:
        pygame = self._pygame
        for event in pygame.event.get():
            if event.type == pygame.QUIT or (event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE):
                self.open = False
            elif event.type == pygame.VIDEORESIZE:
                self._resize()

    def _resize(self) -> None:
        self.screen = self._pygame.display.get_surface() or self.screen
        self.camera.size = self.screen.get_size()

    def _handle(self, event: Any) -> None:
        pygame = self._pygame
        self._at = getattr(event, "pos", self._at)
        if event.type == pygame.QUIT:
            self.open = False
        elif event.type == pygame.VIDEORESIZE:
            self._resize()
        elif event.type == pygame.KEYDOWN and self.controls and self._panel.typing:
            self._panel.key(event)
        elif event.type == pygame.KEYDOWN:
            name: str = pygame.key.name(event.key)
            typed = event.unicode if event.unicode.isprintable() and event.unicode.strip() else ""
            self._key(NAMED.get(name) or typed or name, bool(event.mod & pygame.KMOD_SHIFT))
        elif self.controls:
            self._handle_mouse(event)

    def _control(self, name: str, shift: bool) -> None:
        if name == "tab":
            self._panel.open = not self._panel.open
        else:
            super()._control(name, shift)

    def _close_panel(self) -> bool:
        was_open = self._panel.open
        self._panel.close()
        return was_open

    def _handle_mouse(self, event: Any) -> None:
        pygame, over_panel = self._pygame, self._panel.has(self._at)
        if event.type == pygame.MOUSEWHEEL and over_panel:
            self._panel.scroll(3 * event.y)
        elif event.type == pygame.MOUSEWHEEL:
            self._scrolled(event.y)
        elif event.type == pygame.MOUSEMOTION:
            self._moved(event.rel, bool(event.buttons[1]), bool(event.buttons[2]))
        elif event.type == pygame.MOUSEBUTTONDOWN and over_panel:
            if event.button in (1, 3):
                self._panel.click(event.pos, event.button)
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == 1:
            self._pressed()
        elif event.type == pygame.MOUSEBUTTONUP and event.button == 1:
            self._released()

    def _arrows(self) -> tuple[int, int]:
        keys, pygame = self.keys, self._pygame
        if self._panel.typing:
            return 0, 0
        return (
            int(keys[pygame.K_RIGHT]) - int(keys[pygame.K_LEFT]), int(keys[pygame.K_DOWN]) - int(keys[pygame.K_UP]),
        )  # fmt: skip

    # -- drawing ----------------------------------------------------------------------------------

    def _paint(self, shown: DrawingList) -> None:
        screen, texts = self.screen, self._texts
        if self.below is not None:
            screen.fill(BACKGROUND)
            self.below(self)
        self._painter.show_sleepers(self.show["sleepers"])
        if self.show["outlines"]:
            self._painter.paint(screen, shown, self.camera, ground=self.below is None)
        elif self.below is None:
            screen.fill(BACKGROUND)
        for sprites in self.sprites:
            sprites.draw(screen, self.camera)
        if self.above is not None:
            self.above(self)
        at = self._picked_pixels()
        if at is not None:
            self._pygame.draw.circle(screen, ACCENT, at, 9, 2)
        for word in self._words(self.clock.get_fps()):
            texts.write(screen, *word)
        for table in self._tables():
            texts.box(screen, *table)
        if self._panel.open and self.controls:
            self._panel.draw(screen, self.world, self.picked)
        if self._film is not None:
            self._film.add(screen, 1.0 / self.rate if not self.real_time else self.clock.get_time() / 1000.0)
        self._pygame.display.flip()
        self._painted = True

    def _paint_progress(self, text: str, share: float) -> None:
        screen = self.screen
        width, height = screen.get_size()
        if not self._painted:
            screen.fill(BACKGROUND)
        screen.fill(BACKGROUND, (0, height // 2 - 30, width, 60))
        picture = self._texts.picture(text)
        screen.blit(picture, ((width - picture.get_width()) / 2, height // 2 - 20))
        screen.fill(DIM, (width // 4, height // 2 + 8, width // 2, 2))
        screen.fill(ACCENT, (width // 4, height // 2 + 7, round(share * (width // 2)), 4))
        self._pygame.display.flip()

    def _save_picture(self) -> None:
        name = next(name for k in range(10_000) if not Path(name := f"carom-{k}.png").exists())
        try:
            self._pygame.image.save(self.screen, name)
            self.say(f"saved as {Path(name).resolve()}")
        except (self._pygame.error, OSError) as error:
            self.say(f"{name}: {error}")
