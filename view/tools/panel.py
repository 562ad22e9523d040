"""A panel that shows and sets the fields of a world's settings and of the body that is picked."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ...framework import CaromError, Component, Settings, World
from ...framework.settings import AUTOMATIC, COLLISION_MODES, FAULT_MODES, GEOMETRY_MODES, MIXING_RULES
from ..colours import ACCENT, DIM, ERROR, FIELD, PANEL, TEXT
from .entered import text_of, values_of

WIDTH, ROW, LABEL = 350, 19, 168  # pixels
REFUSED = (ValueError, TypeError, AttributeError, KeyError, CaromError)  # of a value, by what has the field
KNOWN = {"collision": COLLISION_MODES, "geometry": GEOMETRY_MODES, "on_fault": FAULT_MODES}


@dataclasses.dataclass(frozen=True)
class Row:
    """A heading, if it has no value; a field that cannot be set, if it has no setter."""

    name: str
    value: Any = None
    put: Callable[[Any], None] | None = None
    choices: Sequence[Any] = ()
    heading: bool = False
    key: tuple[str, str] = ("", "")


def rows_of(world: World, entity: int | None) -> Iterator[Row]:
    """All that the panel shows: settings, then what the entity has, then its columns that are in no component."""
    yield Row("settings", heading=True)
    for field in dataclasses.fields(Settings):
        value = getattr(world.settings, field.name)
        choices = (False, True) if isinstance(value, bool) else _choices(world, field.name)
        yield Row(field.name, value, _setter_of_settings(world, field.name), choices, key=("settings", field.name))
    yield Row("gravity", world.gravity, lambda value: setattr(world, "gravity", value), key=("world", "gravity"))
    scale = Row("time_scale", world.time_scale, lambda value: setattr(world, "time_scale", value))
    yield dataclasses.replace(scale, key=("world", "time_scale"))
    if entity is None:
        yield Row("no body is picked: click on one", heading=True)
        return
    yield Row(f"entity {entity}", heading=True)
    components = world.components_for_entity(entity)
    for component in components:
        title = type(component).__name__
        yield Row(title, heading=True)
        for name, choices, settable in _fields(component):
            put = _setter(component, name) if settable else None
            yield Row(name, getattr(component, name), put, choices, key=(title, name))
    yield from _columns(world, entity, components)


def _choices(world: World, name: str) -> Sequence[Any]:
    registry = world.registry
    found = {
        **KNOWN,
        "integrator": tuple(registry.integrators),
        "restitution_mixing": (*MIXING_RULES, *registry.mixing_rules),
        "friction_mixing": (*MIXING_RULES, *registry.mixing_rules),
        "broad_phase": (AUTOMATIC, *registry.broad_phases),
    }
    return found.get(name, ())


def _setter_of_settings(world: World, name: str) -> Callable[[Any], None]:
    def put(value: Any) -> None:
        world.settings = world.settings.replace(**{name: value})

    return put


def _setter(component: Any, name: str) -> Callable[[Any], None]:
    return lambda value: setattr(component, name, value)


def _fields(component: Any) -> Iterator[tuple[str, Sequence[Any], bool]]:
    """Names, choices, and whether they are for users to set."""
    if isinstance(component, Component):
        for name, column in component.columns.items():
            yield name, column.choices or ((False, True) if column.dtype is bool else ()), column.constructor
    elif dataclasses.is_dataclass(component):
        yield from ((field.name, (), True) for field in dataclasses.fields(component))
    else:
        yield from ((name, (), True) for name in getattr(component, "__dict__", {}) if name[0] != "_")


def _columns(world: World, entity: int, components: Sequence[Any]) -> Iterator[Row]:
    """Those of its row that no component shows; of components that it does not have they say nothing."""
    bodies = world.bodies
    if entity not in bodies.entity:
        return
    row = bodies.row_of(entity)
    yield Row("columns", heading=True)
    shown = {column.key for c in components if isinstance(c, Component) for column in c.columns.values()}
    yield Row("row", row)
    for name in bodies.column_names():
        if name not in shown and "." not in name:
            yield Row(name, getattr(bodies, name)[row])
    yield Row("asleep", bodies.asleep[row])


class Panel:
    """Drawn at the right of a window; clicks and keys that it takes are not the window's."""

    def __init__(self, pygame: Any, write: Callable[..., None]) -> None:
        self._pygame, self._write = pygame, write
        self.open = False
        self.error = ""
        self._typed: str | None = None  # what stands in the field that is being set
        self._key = ("", "")  # of that field, or of the one that was refused
        self._scroll = 0
        self._shown: list[tuple[Any, Row]] = []  # rectangles of the last frame
        self._area = pygame.Rect(0, 0, 0, 0)

    @property
    def typing(self) -> bool:
        """Whether keys go into a field."""
        return self.open and self._typed is not None

    def has(self, place: Any) -> bool:
        """Whether that pixel of the window is the panel's."""
        return self.open and bool(self._area.collidepoint(place))

    def close(self) -> None:
        self.open, self._typed, self.error = False, None, ""

    def scroll(self, rows: int) -> None:
        self._scroll = max(0, self._scroll - rows)

    def click(self, place: Any, button: int) -> None:
        """Begin to type into the field there, or take its next choice, with the right button the one before."""
        self._typed = None
        for area, row in self._shown:
            if row.put is None or not area.collidepoint(place):
                continue
            self._key = row.key
            if not row.choices:
                self._typed = text_of(row.value)
                return
            choices = list(row.choices)
            now = choices.index(row.value) if row.value in choices else -1
            self._put(row, choices[(now + (1 if button == 1 else -1)) % len(choices)])
            return

    def key(self, event: Any) -> None:
        """A key while :attr:`typing`."""
        pygame = self._pygame
        if event.key == pygame.K_ESCAPE:
            self._typed = None
        elif event.key in (pygame.K_RETURN, pygame.K_KP_ENTER):
            row = next((row for _, row in self._shown if row.key == self._key), None)
            if row is not None:
                self._put(row, values_of(self._typed or ""))
            self._typed = None
        elif event.key == pygame.K_BACKSPACE:
            self._typed = (self._typed or "")[:-1]
        elif event.unicode and event.unicode.isprintable():
            self._typed = (self._typed or "") + event.unicode

    def _put(self, row: Row, value: Any) -> None:
        try:
            assert row.put is not None
            row.put(value)
            self.error = ""
        except REFUSED as error:
            self.error = f"{error.args[0] if error.args else error}"

    def draw(self, surface: Any, world: World, entity: int | None) -> None:
        """Draw it, as far as it goes, at the right of ``surface``."""
        pygame, (width, height) = self._pygame, surface.get_size()
        self._area = pygame.Rect(max(0, width - WIDTH), 0, min(WIDTH, width), height)
        pygame.draw.rect(surface, PANEL, self._area)
        rows = list(rows_of(world, entity))
        wrapped = textwrap.wrap(self.error, 50)[:8]
        room = max(1, (height - 8) // ROW - len(wrapped))
        self._scroll = min(self._scroll, max(0, len(rows) - room))
        self._shown = []
        clip = surface.get_clip()
        surface.set_clip(self._area)
        for k, row in enumerate(rows[self._scroll : self._scroll + room]):
            area = pygame.Rect(self._area.x, 4 + ROW * k, self._area.width, ROW)
            self._draw_row(surface, area, row)
            self._shown.append((area, row))
        for k, line in enumerate(wrapped):
            self._write(surface, line, (self._area.x + 6, height - ROW * (len(wrapped) - k)), ERROR)
        surface.set_clip(clip)

    def _draw_row(self, surface: Any, area: Any, row: Row) -> None:
        if row.heading:
            self._write(surface, row.name, (area.x + 6, area.y + 2), ACCENT)
            return
        ours = row.key == self._key and row.put is not None
        self._write(surface, row.name, (area.x + 12, area.y + 2), ERROR if ours and self.error else TEXT)
        if row.put is not None:
            box = self._pygame.Rect(area.x + LABEL, area.y + 1, area.width - LABEL - 6, ROW - 2)
            self._pygame.draw.rect(surface, FIELD, box, border_radius=3)
        text = f"{self._typed}|" if ours and self._typed is not None else text_of(row.value)
        self._write(surface, text, (area.x + LABEL + 5, area.y + 2), TEXT if row.put is not None else DIM)
