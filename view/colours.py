"""What each style of the drawing list looks like, in every window and film."""

from __future__ import annotations

import numpy as np

from ..drawing import Style

BACKGROUND, GRID = (24, 27, 34), (33, 37, 46)
TEXT, DIM, ERROR, ACCENT = (214, 219, 228), (138, 146, 160), (244, 104, 96), (120, 190, 255)
PANEL, FIELD = (32, 36, 45), (46, 52, 64)
TINTS = 3  # by the entity's number: neighbours of one style differ
_FILLS = {
    Style.STATIC: (78, 86, 100), Style.KINEMATIC: (206, 152, 52), Style.DYNAMIC: (82, 146, 206),
    Style.ASLEEP: (92, 100, 122), Style.SENSOR: (86, 170, 120), Style.ONE_WAY: (222, 202, 96),
    Style.JOINT: (206, 140, 200), Style.CONTACT: (250, 80, 80), Style.NORMAL: (250, 130, 80),
    Style.VELOCITY: (126, 222, 126), Style.BOX: (108, 108, 72),
}  # fmt: skip


def _tinted(colour: tuple[int, int, int], tint: int) -> tuple[int, ...]:
    return tuple(np.clip(np.array(colour) * (1.0, 0.9, 1.1)[tint], 0, 255).astype(int).tolist())


FILLS = np.zeros((max(Style) + 1, TINTS, 3), np.uint8)  # by style and tint
for _style, _colour in _FILLS.items():
    FILLS[_style] = [_tinted(_colour, tint if _style < Style.SENSOR else 0) for tint in range(TINTS)]
FILLS_MARKED = FILLS.copy()  # where sleepers are looked for
FILLS_MARKED[Style.ASLEEP] = [_tinted((168, 96, 214), tint) for tint in range(TINTS)]
EDGES = (FILLS * 0.42).astype(np.uint8)  # of the same: darker


def tints(style: np.ndarray, entity: np.ndarray) -> np.ndarray:
    """(n,) rows of ``FILLS.reshape(-1, 3)``."""
    return style.astype(np.int64) * TINTS + entity % TINTS
