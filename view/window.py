"""A window on a world, with pygame-ce."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..drawing import Drawing
from ..framework import CaromError, FaultError, NoPhysicsError, StepError, World
from ..framework.typing import Vector
from .camera import Camera, corners_of
from .choice import camera_of, painter_of
from .colours import ACCENT, BACKGROUND, DIM, ERROR
from .film import Film
from .packages import package
from .space.orbit import OrbitCamera
from .sprites import Sprites
from .tools.hand import Hand
from .tools.panel import Panel
from .tools.preparation import Preparation
from .tools.rewind import Rewind
from .tools.stages import Stages
from .tools.texts import HELP, Texts

LONGEST = 0.1  # s: a frame that took longer counts as that
SLOWEST, FASTEST = 1 / 64, 8.0  # speed
ZOOM = 1.2  # for one notch of the wheel
PANNED = 400.0  # pixels per second, by the arrows
NAMES = 400  # at most
SHOWN = {"contacts": "c", "velocities": "v", "joints": "j", "sleepers": "z", "boxes": "b", "names": "n"}
SHOWN |= {"times": "t", "outlines": "o"}


class DisplayError(CaromError):
    """There is no display, or it has gone."""


class View:
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
        before it; with ``below`` the ground is theirs
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
        if world.physics is None:
            raise NoPhysicsError(f"View: no physics in world {world.name!r}, so there is nothing to see")
        if not (rate > 0 and math.isfinite(rate)):
            raise ValueError(f"View: rate must be a finite number above 0, got {rate!r}")
        self._pygame = pygame = package("pygame", "carom.view.View")
        self.world, self.title, self.controls, self.rate = world, title, controls, float(rate)
        self.below, self.above, self.real_time = below, above, real_time
        self.sprites: list[Sprites] = [sprites] if isinstance(sprites, Sprites) else list(sprites or ())
        self.camera: Any = camera or camera_of(world)
        self.camera.size = size
        self._film = None if record is None else Film(Path(record))
        self.screen = self._opened(self.camera.size, title)
        self.clock = pygame.time.Clock()
        self.open, self.paused, self.speed = True, False, 1.0
        self.show = {**dict.fromkeys(SHOWN, False), "joints": True, "outlines": outlines}
        self.following = False
        self.keys, self.events = pygame.key.get_pressed(), []
        self._at = pygame.mouse.get_pos()  # of the last event that told it
        self.message, self._message_ends = "", 0.0
        self._help = False
        self._texts = Texts(pygame)
        self._painter = painter_of(world)
        self._panel = Panel(pygame, self._texts.write)
        self._drawing, self._hand, self._stages = Drawing(world), Hand(world), Stages(world)
        self._rewind = Rewind(world, rewind_megabytes) if rewind_megabytes else None
        self._rewinding = 0
        self._prepared_for: Any = None if prepare else world.settings
        self._prepare = prepare
        self._costs = np.zeros(2)  # s of the process, smoothed: the list, and painting it
        self._shown: Any = None
        if camera is None:
            self.fit()

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
        pygame.display.set_caption(title)
        pygame.key.set_repeat(300, 40)
        return screen

    # -- camera -----------------------------------------------------------------------------------

    def fit(self) -> None:
        """Show everything."""
        corners = corners_of(self._drawing.update(joints=False), np.asarray(self.world.bodies.position))
        if corners is not None:
            self.camera.fit(*corners)

    @property
    def picked(self) -> int | None:
        """The entity that was picked; None if none is, or if it is gone."""
        return self._hand.picked

    @picked.setter
    def picked(self, entity: int | None) -> None:
        self._hand.picked = entity

    @property
    def mouse(self) -> Any:
        """The place, (d,) m, under the mouse; in 3D as far away as what is held, or as the middle of the picture."""
        return self.camera.to_world(self._at, self._hand.at if self._hand.holding else None)

    # -- frames -----------------------------------------------------------------------------------

    def run(self, seconds: float = math.inf) -> None:
        """Advance and show the world until the window is closed, or until so many ``seconds`` are simulated.

        What a step raises is shown, and time stands.
        """
        for passed in self:
            try:
                self.world.advance(passed)
            except (StepError, FaultError) as error:
                self.paused = True
                self.say(str(error), seconds=math.inf)
            if self.world.time >= seconds:
                self.close()

    def __iter__(self) -> Iterator[float]:
        try:
            while self.open and not self.world.closed:
                self._make_ready()
                seconds = self._begin() if self.open else 0.0
                if not self.open:
                    break
                yield seconds
                if self.open and not self.world.closed:
                    self._draw()
        except self._pygame.error as error:
            if self._pygame.display.get_init():
                raise DisplayError(f"the display has gone: {error}") from error
        finally:
            self.close()

    def close(self) -> None:
        """Close the window and end the film; twice is fine."""
        self.open = False
        if not self.world.closed:
            self._hand.release()
        if self._film is not None:
            film, self._film = self._film, None
            film.close()
        if self._pygame.display.get_init():
            self._pygame.display.quit()

    def say(self, text: str, seconds: float = 3.0) -> None:
        """Show a line for so many ``seconds``."""
        self.message, self._message_ends = text, time.monotonic() + seconds

    def _make_ready(self) -> None:
        """Compile what the world may need, and go on to hear keys."""
        if not self._prepare or self._prepared_for is self.world.settings:
            return
        work = Preparation(self.world)
        try:
            while self.open and not work.wait(1 / 30):
                for event in self._pygame.event.get():
                    escape = event.type == self._pygame.KEYDOWN and event.key == self._pygame.K_ESCAPE
                    if event.type == self._pygame.QUIT or escape:
                        self.open = False
                    elif event.type == self._pygame.VIDEORESIZE:
                        self._resize()
                self._draw_progress(work)
            if not self.open:
                self._pygame.display.quit()  # before the kernel that compiles now has come to its end
        finally:
            work.stop()
        self._prepared_for = self.world.settings
        self.clock.tick()

    def _draw_progress(self, work: Preparation) -> None:
        screen = self.screen
        if self._shown is None:
            screen.fill(BACKGROUND)
        width, height = screen.get_size()
        area = self._pygame.Rect(0, height // 2 - 30, width, 60)
        screen.fill(BACKGROUND, area)
        text = self._texts.picture(work.text)
        screen.blit(text, ((width - text.get_width()) / 2, height // 2 - 20))
        screen.fill(DIM, (width // 4, height // 2 + 8, width // 2, 2))
        screen.fill(ACCENT, (width // 4, height // 2 + 7, round(work.share * (width // 2)), 4))
        self._pygame.display.flip()

    def _begin(self) -> float:
        """Hear what has come; the seconds of this frame."""
        passed = self._tick()
        self.events, steps = self._pygame.event.get(), 0
        for event in self.events:
            steps += self._handle(event)
            if not self.open:
                return 0.0
        self.keys = self._pygame.key.get_pressed()
        try:
            self._go_through_time(steps)
        except CaromError as error:
            self.paused = True
            self.say(str(error), seconds=math.inf)
        if self.controls and not self._panel.typing:
            self._pan(passed)
        if self._hand.holding:
            self._hand.drag(self.mouse, self.paused)
        if self.following and self.picked is not None:
            bodies = self.world.bodies
            if self.picked in bodies.entity:
                place = bodies.interpolated_position[bodies.row_of(self.picked)]
                if np.isfinite(place).all():
                    self.camera.follow(place, passed)
        return 0.0 if self.paused else passed * self.speed

    def _tick(self) -> float:
        if not self.real_time:
            self.clock.tick()
            return 1.0 / self.rate
        return min(self.clock.tick(self.rate) / 1000.0, LONGEST)

    def _go_through_time(self, steps: int) -> None:
        rewind = self._rewind
        if rewind is not None:
            if self._rewinding:
                self.paused = True
                self._hand.release()
                if not (rewind.back() if self._rewinding < 0 else rewind.forth()):
                    self.say("this is the oldest that is kept" if self._rewinding < 0 else "this is the present")
                self._hand.release()  # a pull that came back
                self._rewinding = 0
            else:
                rewind.keep()
        for _ in range(steps):
            self.world.step()

    def _pan(self, seconds: float) -> None:
        keys, pygame = self.keys, self._pygame
        x = int(keys[pygame.K_RIGHT]) - int(keys[pygame.K_LEFT])
        y = int(keys[pygame.K_DOWN]) - int(keys[pygame.K_UP])
        if x or y:
            self.following = False
            self.camera.pan((-x * PANNED * seconds, -y * PANNED * seconds))

    # -- events -----------------------------------------------------------------------------------

    def _resize(self) -> None:
        self.screen = self._pygame.display.get_surface() or self.screen
        self.camera.size = self.screen.get_size()

    def _handle(self, event: Any) -> int:
        """Returns how many single steps are asked for."""
        pygame = self._pygame
        self._at = getattr(event, "pos", self._at)
        if event.type == pygame.QUIT:
            self.open = False
        elif event.type == pygame.VIDEORESIZE:
            self._resize()
        elif event.type == pygame.KEYDOWN:
            if event.key == pygame.K_F10:
                self.controls = not self.controls
                self._hand.release()
                self._panel.close()
            elif event.key == pygame.K_F1:
                self._help = not self._help
            elif self.controls and self._panel.typing:
                self._panel.key(event)
            elif self.controls:
                return self._handle_key(event)
        elif self.controls:
            self._handle_mouse(event)
        return 0

    def _handle_key(self, event: Any) -> int:
        pygame, key = self._pygame, event.key
        if key == pygame.K_ESCAPE:
            if self._help or self._panel.open:
                self._help = False
                self._panel.close()
            else:
                self.open = False
        elif key == pygame.K_SPACE:
            self.paused = not self.paused
            self._message_ends = 0.0
        elif key == pygame.K_PERIOD:
            self.paused = True
            return 1
        elif key == pygame.K_BACKSPACE:
            self._rewinding = 1 if event.mod & pygame.KMOD_SHIFT else -1
        elif key in (pygame.K_MINUS, pygame.K_KP_MINUS):
            self.speed = max(self.speed / 2, SLOWEST)
        elif key in (pygame.K_PLUS, pygame.K_EQUALS, pygame.K_KP_PLUS):
            self.speed = min(self.speed * 2, FASTEST)
        elif key == pygame.K_0:
            self.speed = 1.0
        elif key == pygame.K_HOME:
            self.following = False
            self.fit()
        elif key == pygame.K_f:
            self.following = not self.following and self.picked is not None
        elif key == pygame.K_TAB:
            self._panel.open = not self._panel.open
        elif key == pygame.K_F12:
            self._save_picture()
        else:
            for name, letter in SHOWN.items():
                if event.unicode == letter:
                    self.show[name] = not self.show[name]
        return 0

    def _handle_mouse(self, event: Any) -> None:
        pygame = self._pygame
        if event.type == pygame.MOUSEWHEEL:
            if self._panel.has(self._at):
                self._panel.scroll(3 * event.y)
            else:
                self.camera.zoom(ZOOM**event.y, self._at)
        elif event.type == pygame.MOUSEMOTION and (event.buttons[1] or event.buttons[2]):
            if event.buttons[2] and self.world.dimensions == 3:
                self.camera.turn(event.rel)
            else:
                self.following = False
                self.camera.pan(event.rel)
        elif event.type == pygame.MOUSEBUTTONDOWN and self._panel.has(event.pos):
            if event.button in (1, 3):
                self._panel.click(event.pos, event.button)
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == 1:
            place = self._hand.pick(self.camera, event.pos)
            if place is not None:
                self._hand.take(place, self.paused)
        elif event.type == pygame.MOUSEBUTTONUP and event.button == 1:
            self._hand.release()

    def _save_picture(self) -> None:
        name = next(name for k in range(10_000) if not Path(name := f"carom-{k}.png").exists())
        try:
            self._pygame.image.save(self.screen, name)
            self.say(f"saved as {Path(name).resolve()}")
        except (self._pygame.error, OSError) as error:
            self.say(f"{name}: {error}")

    # -- drawing ----------------------------------------------------------------------------------

    def _draw(self) -> None:
        began = time.process_time()
        show, screen = self.show, self.screen
        shown = self._drawing.update(
            joints=show["joints"], contacts=show["contacts"], velocities=show["velocities"], boxes=show["boxes"],
        )  # fmt: skip
        listed = time.process_time()
        if self.below is not None:
            self.below(self)
        self._painter.show_sleepers(show["sleepers"])
        if show["outlines"]:
            self._painter.paint(screen, shown, self.camera, ground=self.below is None)
        elif self.below is None:
            screen.fill(BACKGROUND)
        for sprites in self.sprites:
            sprites.draw(screen, self.camera)
        if self.above is not None:
            self.above(self)
        self._shown = shown
        self._draw_tools()
        painted = time.process_time()
        self._costs += 0.1 * (np.array((listed - began, painted - listed)) - self._costs)
        if self._film is not None:
            self._film.add(screen, 1.0 / self.rate if not self.real_time else self.clock.get_time() / 1000.0)
        self._pygame.display.flip()

    def _draw_tools(self) -> None:
        screen, texts = self.screen, self._texts
        picked = self.picked
        if self.controls:
            speed = "" if self.speed == 1 else f"  x{self.speed:g}"
            state = f"{self.world.time:.2f} s{speed}{'  PAUSED' if self.paused else ''}"
            rates = f"{len(self.world.bodies):,} bodies  {self.clock.get_fps():.0f} fps"
            texts.write(screen, f"{state}  {rates}  F1: keys", (8, 6))
        if picked is not None:
            self._draw_picked(picked)
        if self.show["names"]:
            self._draw_names()
        if self.show["times"]:
            rows = [("list", f"{1e3 * self._costs[0]:.2f} ms"), ("paint", f"{1e3 * self._costs[1]:.2f}")]
            texts.box(screen, [*rows, *self._stages.update()], (8, 48), (190, 80))
        if self._help:
            texts.box(screen, [*HELP], (max(0, screen.get_width() // 2 - 180), 40), (150, 200))
        if self._panel.open and self.controls:
            self._panel.draw(screen, self.world, picked)
        if time.monotonic() < self._message_ends:
            texts.write(screen, self.message, (8, screen.get_height() - 24), ERROR)

    def _draw_picked(self, picked: int) -> None:
        bodies = self.world.bodies
        if picked not in bodies.entity:
            return
        row = bodies.row_of(picked)
        place, velocity = bodies.interpolated_position[row], bodies.linear_velocity[row]
        pixels = self.camera.to_screen(place)
        if not (np.abs(pixels) < 1e4).all():
            return
        self._pygame.draw.circle(self.screen, ACCENT, pixels.tolist(), 9, 2)
        if self.controls:
            kinds = ", ".join(type(one).__name__ for one in self.world.components_for_entity(picked))
            at, speed = ", ".join(f"{x:.3f}" for x in place.tolist()), float(np.linalg.norm(velocity))
            self._texts.write(self.screen, f"entity {picked}: {kinds}; at ({at}) m, {speed:.3f} m/s", (8, 26), ACCENT)

    def _draw_names(self) -> None:
        bodies = self.world.bodies
        pixels = self.camera.to_screen(bodies.interpolated_position)
        seen = np.flatnonzero(((pixels > 0) & (pixels < self.camera.size)).all(axis=1))
        seen = seen[:: max(1, -(-len(seen) // NAMES))]
        for place, entity in zip(pixels[seen].tolist(), bodies.entity[seen].tolist(), strict=True):
            self._texts.write(self.screen, str(entity), place)
