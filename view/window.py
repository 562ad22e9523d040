"""What every window on a world does, whatever draws it: frames, time, the camera, keys and the mouse."""

from __future__ import annotations

import math
import numbers
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..drawing import Drawing, DrawingList
from ..framework import CaromError, FaultError, NoPhysicsError, StepError, World
from .camera import corners_of
from .choice import camera_of
from .colours import ACCENT, ERROR, TEXT
from .tools.hand import Hand
from .tools.preparation import Preparation
from .tools.rewind import Rewind
from .tools.stages import Stages

LONGEST = 0.1  # s: a frame that took longer counts as that
SLOWEST, FASTEST = 1 / 64, 8.0  # speed
ZOOM = 1.2  # for one notch of the wheel
PANNED = 400.0  # pixels per second, by the arrows
NAMES = 400  # at most
KERNELS = "collision", "geometry", "integrator", "sleeping", "broad_phase", "friction_mixing", "restitution_mixing"
SHOWN = {"contacts": "c", "velocities": "v", "joints": "j", "sleepers": "z", "boxes": "b", "names": "n"}
SHOWN |= {"times": "t", "outlines": "o"}
HELP = (
    ("space", "pause, go on"), (".", "one step"), ("backspace, shift", "back in time; forth"),
    ("- + 0", "slower, faster, as it is"), ("wheel", "zoom at the mouse"), ("right button", "pan; in 3D turn"),
    ("middle, arrows", "pan"), ("left button", "pick, drag"), ("f", "follow what is picked"),
    ("home", "all in the picture"), ("tab", "panel: settings, body"), ("c", "contacts and normals"),
    ("v", "velocities"), ("j", "joints"), ("z", "sleepers in violet"), ("b", "boxes of the broad phase"),
    ("n", "names"), ("t", "milliseconds by stage"), ("o", "outlines of shapes"), ("F12", "save a picture"),
    ("F10", "these keys on, off"), ("F1", "this help"), ("escape", "close"),
)  # fmt: skip

Word = tuple[str, Any, Any]  # text, (x, y) pixels, colour
Table = tuple[list[tuple[str, ...]], tuple[int, int], tuple[int, ...]]  # rows, (x, y), pixels of each column


class DisplayError(CaromError):
    """There is no display, or it has gone."""


class Window(ABC):
    """A window on a world, until it is closed; see :class:`View` for what its arguments mean."""

    def __init__(
        self, world: World, size: Any, camera: Any, title: str, controls: bool, outlines: bool, rate: float,
        rewind_megabytes: float, prepare: bool, real_time: bool,
    ) -> None:  # fmt: skip
        if world.physics is None:
            raise NoPhysicsError(f"View: no physics in world {world.name!r}, so there is nothing to see")
        if not (rate > 0 and math.isfinite(rate)):
            raise ValueError(f"View: rate must be a finite number above 0, got {rate!r}")
        self._world, self.title, self.controls = world, title, controls
        self.rate, self.real_time = float(rate), real_time
        self.camera: Any = camera or camera_of(world)
        if len(self.camera.middle) != world.dimensions:
            raise ValueError(f"View: {world!r} has {world.dimensions} dimensions, the camera {len(self.camera.middle)}")
        self.camera.size = size
        self.open, self.paused, self.speed, self.following = True, False, 1.0, False
        self.show = {**dict.fromkeys(SHOWN, False), "joints": True, "outlines": outlines}
        self.message, self._message_ends = "", 0.0
        self._at: Any = (0, 0)  # pixels, where the mouse is
        self._help = False
        self._steps = 0  # single ones that are asked for
        self._drawing, self._hand, self._stages = Drawing(world), Hand(world), Stages(world)
        self._rewind = Rewind(world, rewind_megabytes) if rewind_megabytes else None
        self._rewinding = 0
        self._prepare = prepare
        self._prepared_for: Any = None  # what of the settings
        self._costs = np.zeros(2)  # s of the process, smoothed: the list, and painting it
        if camera is None:
            self.fit()

    @property
    def world(self) -> World:
        """The world that is shown; another one gets a view of its own, which takes over the window."""
        return self._world

    @world.setter
    def world(self, world: World) -> None:
        raise AttributeError("a view shows one world: for the next level end its loop, and make another View(world)")

    @property
    def speed(self) -> float:
        """Seconds of the world per second: 1 as it is. ValueError for what is no finite number of at least 0."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        if isinstance(speed, bool) or not (isinstance(speed, numbers.Real) and 0 <= speed < math.inf):
            raise ValueError(f"View: speed must be a finite number of at least 0, got {speed!r}")
        self._speed = float(speed)

    # -- what draws -------------------------------------------------------------------------------

    @abstractmethod
    def _hear(self) -> None:
        """Take what has come from keys and mouse: ``_key``, ``_moved``, ``_pressed``, ``_released``, ``_scrolled``."""

    @abstractmethod
    def _tick(self) -> float:
        """Wait for the next frame; the seconds since the last."""

    @abstractmethod
    def _paint(self, shown: DrawingList) -> None:
        """Paint the world and what is written over it, and show it."""

    @abstractmethod
    def _paint_progress(self, text: str, share: float) -> None:
        """Show what is done while kernels compile, 0 to 1."""

    @abstractmethod
    def _arrows(self) -> tuple[int, int]:
        """How many arrows are held: to the right, and down."""

    @abstractmethod
    def _shut(self) -> None:
        """Close what is on the screen; twice is fine."""

    @abstractmethod
    def _save_picture(self) -> None:
        """Save what is shown."""

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

        What a step raises is shown, and time stands; with ``seconds``, which would never pass, it is raised.
        """
        for passed in self:
            try:
                if passed > 0.0:  # else a step that has failed is due again, in each frame
                    self.world.advance(passed)
            except (StepError, FaultError) as error:
                if seconds < math.inf:
                    raise
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
        finally:
            self.close()

    def close(self) -> None:
        """Close the window; twice is fine."""
        self.open = False
        if not self.world.closed:
            self._hand.release()
        self._shut()

    def say(self, text: str, seconds: float = 3.0) -> None:
        """Show a line of ``text`` for so many ``seconds``."""
        self.message, self._message_ends = text, time.monotonic() + seconds

    def _make_ready(self) -> None:
        """Compile what the world may need, and go on to hear keys."""
        kernels = tuple(getattr(self.world.settings, name) for name in KERNELS)
        if not self._prepare or self._prepared_for == kernels:
            return
        work = Preparation(self.world)
        try:
            while self.open and not work.wait(1 / 30):
                self._hear_close()
                if self.open:
                    self._paint_progress(work.text, work.share)
            if not self.open:
                self._shut()  # before the kernel that compiles now has come to its end
        finally:
            work.stop()
        self._prepared_for = kernels
        if self.open and self.real_time:
            self._tick()

    @abstractmethod
    def _hear_close(self) -> None:
        """Take what has come, and heed what closes the window alone: the world is not to be touched."""

    def _begin(self) -> float:
        """Hear what has come; the seconds of this frame."""
        passed = self._tick()
        self._steps = 0
        self._hear()
        if not self.open:
            return 0.0
        try:
            self._go_through_time()
        except CaromError as error:
            self.paused = True
            self.say(str(error), seconds=math.inf)
        right, down = self._arrows() if self.controls else (0, 0)
        if right or down:
            self.following = False
            self.camera.pan((-right * PANNED * passed, -down * PANNED * passed))
        if self._hand.holding:
            self._hand.drag(self.mouse, self.paused)
        if self.following and self.picked is not None:
            place = self._place_of(self.picked)
            if place is not None:
                self.camera.follow(place, passed)
        return 0.0 if self.paused else passed * self.speed

    def _place_of(self, entity: int) -> Any:
        """(d,) m, where it is drawn; None if it is no body, or nowhere."""
        bodies = self.world.bodies
        if entity not in bodies.entity:
            return None
        place = bodies.interpolated_position[bodies.row_of(entity)]
        return place if np.isfinite(place).all() else None

    def _go_through_time(self) -> None:
        rewind = self._rewind
        if rewind is not None and self._rewinding:
            self.paused = True
            self._hand.release()
            if not (rewind.back() if self._rewinding < 0 else rewind.forth()):
                self.say("this is the oldest that is kept" if self._rewinding < 0 else "this is the present")
            self._hand.release()  # a pull that came back
            self._rewinding = 0
        elif rewind is not None:
            rewind.keep()
        for _ in range(self._steps):
            self.world.step()

    def _draw(self) -> None:
        began, show = time.process_time(), self.show
        shown = self._drawing.update(
            joints=show["joints"], contacts=show["contacts"], velocities=show["velocities"], boxes=show["boxes"],
        )  # fmt: skip
        listed = time.process_time()
        self._paint(shown)
        painted = time.process_time()
        self._costs += 0.1 * (np.array((listed - began, painted - listed)) - self._costs)

    # -- keys and mouse ---------------------------------------------------------------------------

    def _key(self, name: str, shift: bool = False) -> None:
        """A key was pressed; names are those of pygame, of letters the letter."""
        if name == "f10":
            self.controls = not self.controls
            self._hand.release()
            self._close_panel()
        elif name == "f1":
            self._help = not self._help
        elif self.controls:
            self._control(name, shift)

    def _control(self, name: str, shift: bool) -> None:
        if name == "escape":
            self.open = self._help or self._close_panel()
            self._help = False
        elif name == "space":
            self.paused = not self.paused
            self._message_ends = 0.0
        elif name == ".":
            self.paused = True
            self._steps += 1
        elif name == "backspace":
            self._rewinding = 1 if shift else -1
        elif name == "-":
            self.speed = max(self.speed / 2, SLOWEST)
        elif name in ("+", "="):
            self.speed = min(self.speed * 2, FASTEST)
        elif name == "0":
            self.speed = 1.0
        elif name == "home":
            self.following = False
            self.fit()
        elif name == "f":
            self.following = not self.following and self.picked is not None
        elif name == "f12":
            self._save_picture()
        else:
            for what, letter in SHOWN.items():
                self.show[what] ^= name == letter

    def _close_panel(self) -> bool:
        """Close it; whether there was one."""
        return False

    def _scrolled(self, notches: float) -> None:
        self.camera.zoom(ZOOM**notches, self._at)

    def _moved(self, by: Any, middle: bool, right: bool) -> None:
        """The mouse has gone so many pixels, with these buttons held."""
        if right and self.world.dimensions == 3:
            self.camera.turn(by)
        elif middle or right:
            self.following = False
            self.camera.pan(by)

    def _pressed(self) -> None:
        """The left button, where the mouse is."""
        try:
            place = self._hand.pick(self.camera, self._at)
            if place is not None:
                self._hand.take(place, self.paused)
        except CaromError as error:  # of a query: a shape that has no answer to it
            self.say(str(error))

    def _released(self) -> None:
        self._hand.release()

    # -- what is written --------------------------------------------------------------------------

    def _words(self, rate: float) -> list[Word]:
        """Lines of text over the picture, at ``rate`` frames per second."""
        words: list[Word] = []
        if self.controls:
            speed = "" if self.speed == 1 else f"  x{self.speed:g}"
            state = f"{self.world.time:.2f} s{speed}{'  PAUSED' if self.paused else ''}"
            words.append((f"{state}  {len(self.world.bodies):,} bodies  {rate:.0f} fps  F1: keys", (8, 6), TEXT))
            if self.picked is not None:
                words.append((self._picked_line(self.picked), (8, 26), ACCENT))
        if self.show["names"]:
            bodies = self.world.bodies
            pixels = self.camera.to_screen(bodies.interpolated_position)
            seen = np.flatnonzero(((pixels > 0) & (pixels < self.camera.size)).all(axis=1))
            seen = seen[:: max(1, -(-len(seen) // NAMES))]
            places = zip(pixels[seen].tolist(), bodies.entity[seen].tolist(), strict=True)
            words += [(str(entity), (x - 4, y - 6), TEXT) for (x, y), entity in places]
        if time.monotonic() < self._message_ends:
            words.append((self.message, (8, self.camera.size[1] - 24), ERROR))
        return words

    def _picked_line(self, picked: int) -> str:
        kinds = ", ".join(type(one).__name__ for one in self.world.components_for_entity(picked))
        place = self._place_of(picked)
        if place is None:
            return f"entity {picked}: {kinds}"
        bodies = self.world.bodies
        speed = float(np.linalg.norm(bodies.linear_velocity[bodies.row_of(picked)]))
        return f"entity {picked}: {kinds}; at ({', '.join(f'{x:.3f}' for x in place.tolist())}) m, {speed:.3f} m/s"

    def _picked_pixels(self) -> Any:
        """(x, y) of the picked body; None if it is not to be marked."""
        place = None if self.picked is None else self._place_of(self.picked)
        pixels = None if place is None else self.camera.to_screen(place)
        return None if pixels is None or not (np.abs(pixels) < 1e4).all() else pixels.tolist()

    def _tables(self) -> list[Table]:
        """Tables over the picture."""
        tables: list[Table] = []
        if self.show["times"]:
            rows = [("list", f"{1e3 * self._costs[0]:.2f} ms"), ("paint", f"{1e3 * self._costs[1]:.2f}")]
            tables.append(([*rows, *self._stages.update()], (8, 48), (190, 80)))
        if self._help:
            tables.append(([*HELP], (max(0, self.camera.size[0] // 2 - 180), 40), (150, 200)))
        return tables
