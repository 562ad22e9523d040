"""Pictures that follow bodies."""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import Any

import numpy as np

from ..framework import World
from ..framework.typing import Entities, Vector
from .camera import Camera
from .packages import package

KEPT_GONE = 4096  # sprites of bodies that are gone: a restore may bring these back
MOST_LOOKS = 1000  # surfaces that are kept, though no sprite has them
MOST_ANGLES = 512  # pictures of a turn
LARGEST = 4096  # pixels, that a picture is made high or wide


class Sprites:
    """Pictures that follow the bodies of a world, in 2D, between two steps and turned like these::

        sprites = Sprites(world)
        sprites.add(hero, surface, metres=1.4)
        sprites.draw(screen, camera)                # or View(world, sprites=sprites)

    smooth
        whether pictures are smoothed when they change their size; False for pixel art
    cache_megabytes
        what turned and scaled pictures may take; those used least recently go first

    What has been drawn into a surface after its first use is not seen: take another surface. Sprites of bodies that are
    deleted are not drawn, and forgotten in time; where ``world.restore`` brings a body back its sprite is there again.
    ValueError for worlds that are not 2D.
    """

    def __init__(self, world: World, *, smooth: bool = True, cache_megabytes: float = 64.0) -> None:
        self._pygame = package("pygame", "carom.view.Sprites")
        if world.dimensions != 2:
            raise ValueError(f"Sprites are for worlds in 2D, {world!r} has {world.dimensions} dimensions")
        self.world, self.smooth = world, smooth
        self._most_bytes = int(cache_megabytes * 1e6)
        self._looks: dict[Any, int] = {}  # by surface, height and whether it is mirrored
        self._most_looks = MOST_LOOKS
        self._pictures: list[tuple[Any, float, bool]] = []  # by look: the surface, its height in m, whether mirrored
        self._radii = np.zeros(0)  # m, by look, from the middle to a corner
        self._cached: OrderedDict[tuple[int, int, int], Any] = OrderedDict()
        self._cached_bytes = 0
        self._clear()

    def _clear(self) -> None:
        self._count, self._place = 0, {}  # by entity: its place in the arrays
        self._entity, self._look = np.empty(0, np.int64), np.empty(0, np.int64)
        self._offset, self._z = np.empty((0, 2)), np.empty(0)

    def __len__(self) -> int:
        """How many have a sprite, those that are gone included."""
        return len(self._place)

    def add(
        self,
        entity: int | Entities,
        surface: Any,
        metres: float = 1.0,
        offset: Vector = (0.0, 0.0),
        flip: bool = False,
        z: float = 0.0,
    ) -> None:
        """Give a body, or each of many, a picture; one that has a sprite gets this one in its place.

        surface
            pygame.Surface
        metres
            m, how high it is; its width follows
        offset
            (2,) m from the body's position to the middle of the picture, turned with the body
        flip
            whether left and right are exchanged
        z
            what has more is drawn later; equal ones in order of addition

        ValueError if the picture is empty or a value is not finite.
        """
        if not isinstance(surface, self._pygame.Surface):
            raise TypeError(f"Sprites.add: surface must be a pygame.Surface, got {surface!r}")
        if not (math.isfinite(metres) and metres > 0):
            raise ValueError(f"Sprites.add: metres must be a finite number above 0, got {metres!r}")
        if 0 in surface.get_size():
            raise ValueError(f"Sprites.add: the surface has no pixels, its size is {surface.get_size()}")
        shift = np.array(offset, float)
        if shift.shape != (2,) or not (np.isfinite(shift).all() and math.isfinite(z)):
            raise ValueError(f"Sprites.add: offset must be two finite numbers and z one, got {offset!r}, {z!r}")
        look = self._look_of(surface, float(metres), bool(flip))
        for one in np.atleast_1d(entity).tolist():
            place = self._place.setdefault(one, self._count)
            if place == self._count:
                self._grow()
            self._entity[place], self._look[place] = one, look
            self._offset[place], self._z[place] = shift, z

    def _grow(self) -> None:
        self._count += 1
        if self._count <= len(self._entity):
            return
        room = max(64, 2 * self._count)
        for name in ("_entity", "_look", "_offset", "_z"):
            old = getattr(self, name)
            new = np.zeros((room, *old.shape[1:]), old.dtype)
            new[: len(old)] = old
            setattr(self, name, new)

    def _look_of(self, surface: Any, metres: float, flip: bool) -> int:
        key = id(surface), metres, flip  # the surface is kept, so no other gets its id
        if key not in self._looks:
            if len(self._pictures) >= self._most_looks:
                self._forget_looks()
            self._looks[key] = len(self._pictures)
            self._pictures.append((surface, metres, flip))
            width, height = surface.get_size()
            self._radii = np.append(self._radii, metres / height * math.hypot(width, height) / 2)
        return self._looks[key]

    def _forget_looks(self) -> None:
        """Those that no sprite has any more: games may draw a surface for each frame."""
        used, self._look[: self._count] = np.unique(self._look[: self._count], return_inverse=True)
        self._pictures = [self._pictures[look] for look in used.tolist()]
        self._radii = self._radii[used]
        self._looks = {(id(surface), *rest): look for look, (surface, *rest) in enumerate(self._pictures)}
        self._cached.clear()
        self._cached_bytes = 0
        self._most_looks = 2 * len(used) + MOST_LOOKS

    def remove(self, entity: int) -> None:
        """Take away the sprite of ``entity``; nothing happens if it has none."""
        if entity in self._place:
            self._keep(self._entity[: self._count] != entity)

    def _keep(self, kept: Any) -> None:
        chosen = np.flatnonzero(kept)
        for name in ("_entity", "_look", "_offset", "_z"):
            setattr(self, name, getattr(self, name)[chosen])
        self._count = len(chosen)
        self._place = {entity: place for place, entity in enumerate(self._entity.tolist())}

    # -- drawing ----------------------------------------------------------------------------------

    def draw(self, surface: Any, camera: Camera) -> int:
        """Draw what ``camera`` sees onto a pygame.Surface, with one ``fblits``; returns how many were drawn.

        ValueError if the camera counts pixels upwards, as no surface does.
        """
        if camera.y_up:
            raise ValueError("Sprites.draw: a pygame.Surface counts pixels from above: Camera(y_up=False)")
        rows = self._rows()
        here = np.flatnonzero(rows >= 0)
        if not len(here):
            return 0
        bodies, rows = self.world.bodies, rows[here]
        looks = self._look[here]
        angles, places = bodies.interpolated_rotation[rows], bodies.interpolated_position[rows]
        shifts = self._offset[here]
        if shifts.any():
            c, s = np.cos(angles), np.sin(angles)
            places = places + np.stack((c * shifts[:, 0] - s * shifts[:, 1], s * shifts[:, 0] + c * shifts[:, 1]), 1)
        with np.errstate(over="ignore", invalid="ignore"):
            pixels = camera.to_screen(places)
        radii = self._radii[looks] * camera.scale
        with np.errstate(invalid="ignore"):  # where a body is at NaN
            seen = ((pixels > -radii[:, None]) & (pixels < radii[:, None] + camera.size)).all(axis=1)
        chosen = np.flatnonzero(seen & np.isfinite(angles))
        z = self._z[here[chosen]]
        if z.any():
            chosen = chosen[np.argsort(z, kind="stable")]
        looks, pixels, radii = looks[chosen], pixels[chosen], radii[chosen]
        steps = np.clip(2 * np.pi * radii, 16, MOST_ANGLES).astype(np.int64)  # the corner is half a pixel off
        turns = np.rint(angles[chosen] * steps / (2 * np.pi)).astype(np.int64) % steps
        keys, which = np.unique(looks * MOST_ANGLES + turns, return_inverse=True)
        made = [self._picture(key // MOST_ANGLES, key % MOST_ANGLES, camera.scale) for key in keys.tolist()]
        halves = np.array([picture.get_size() for picture in made], float).reshape(-1, 2)[which] / 2
        corners = np.rint(pixels - halves).astype(np.int64).tolist()
        surface.fblits([(made[k], corner) for k, corner in zip(which.tolist(), corners, strict=True)])
        return len(corners)

    def _rows(self) -> Any:
        """Of the bodies, -1 for those that are gone; the oldest of these are forgotten if there are many."""
        self.world.bodies  # noqa: B018 - takes in what has come and gone
        table: Any = self.world.physics.table  # type: ignore[union-attr]
        rows = table.rows_of(self._entity[: self._count])
        gone = np.flatnonzero(rows < 0)
        if len(gone) > 2 * KEPT_GONE:
            kept = np.ones(self._count, bool)
            kept[gone[:-KEPT_GONE]] = False
            self._keep(kept)
            return rows[kept]
        return rows

    def _picture(self, look: int, turn: int, scale: float) -> Any:
        """Scaled and turned, out of the cache or new."""
        surface, metres, flip = self._pictures[look]
        width, height = surface.get_size()
        factor = min(metres * scale / height, LARGEST / max(width, height))
        key = look, turn, round(1e4 * factor)
        found = self._cached.get(key)
        if found is not None:
            self._cached.move_to_end(key)
            return found
        radius = self._radii[look] * scale
        degrees = 360.0 * turn / int(np.clip(2 * np.pi * radius, 16, MOST_ANGLES))
        made = self._made(surface, factor, degrees, flip)
        self._cached[key] = made
        self._cached_bytes += made.get_width() * made.get_height() * 4
        while self._cached_bytes > self._most_bytes and len(self._cached) > 1:
            _, old = self._cached.popitem(last=False)
            self._cached_bytes -= old.get_width() * old.get_height() * 4
        return made

    def _made(self, surface: Any, factor: float, degrees: float, flip: bool) -> Any:
        transform = self._pygame.transform
        if surface.get_bitsize() < 24:
            surface = surface.convert_alpha(self._pygame.Surface((1, 1), self._pygame.SRCALPHA))
        if flip:
            surface = transform.flip(surface, True, False)
        size = [max(1, round(factor * length)) for length in surface.get_size()]
        if size != [*surface.get_size()]:
            surface = (transform.smoothscale if self.smooth else transform.scale)(surface, size)
        if not degrees:
            return surface
        if not surface.get_flags() & self._pygame.SRCALPHA:  # else its corners are black
            surface = surface.convert_alpha(self._pygame.Surface((1, 1), self._pygame.SRCALPHA))
        return transform.rotozoom(surface, degrees, 1.0) if self.smooth else transform.rotate(surface, degrees)
