"""Words in a window: what is written often is kept as a picture."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

from ..colours import TEXT

MOST = 2048  # pictures
SIZE = 18


class Texts:
    """Writes onto surfaces."""

    def __init__(self, pygame: Any) -> None:
        pygame.font.init()
        self._font = pygame.font.Font(None, SIZE)
        self._kept: OrderedDict[tuple[str, Any], Any] = OrderedDict()
        self._pygame = pygame

    def picture(self, text: str, colour: Any = TEXT) -> Any:
        key = text, colour
        found = self._kept.get(key)
        if found is None:
            found = self._kept[key] = self._font.render(text, True, colour)
            if len(self._kept) > MOST:
                self._kept.popitem(last=False)
        return found

    def write(self, surface: Any, text: str, place: Any, colour: Any = TEXT) -> None:
        """A line with its upper left corner at a place (2,) pixels."""
        surface.blit(self.picture(text, colour), place)

    def box(self, surface: Any, rows: list[tuple[str, ...]], place: Any, widths: tuple[int, ...]) -> None:
        """Rows of columns of so many pixels, on a dark ground."""
        ground = self._pygame.Surface((sum(widths) + 20, SIZE * len(rows) + 16), self._pygame.SRCALPHA)
        ground.fill((16, 18, 24, 225))
        surface.blit(ground, place)
        for k, row in enumerate(rows):
            left = place[0] + 10
            for text, width in zip(row, widths, strict=True):
                self.write(surface, text, (left, place[1] + 8 + SIZE * k))
                left += width
