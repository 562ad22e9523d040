"""Published errors and times for scenes of this library, for comparison on the same axes."""

from __future__ import annotations

from carom.lab.measure.timing import Spread
from carom.lab.trading.records import Cell, Curve, ErrorBar, Point

SCENE, NORM = "bouncing", "energy_square"  # where the points belong; the norm is a mean of squares, in J²
SECONDS = 20.0  # simulated time that the published times are for

SOURCE = (
    "RaiSim, ODE, Bullet, DART: published by SimBenchmark (leggedrobotics/SimBenchmark, data/bouncing, error reduction"
    " off); times of another machine (Intel i7-7700HQ, 49 balls)"
)


def _curve(engine: str, *rows: tuple[float, float, float]) -> Curve:
    """A curve of (dt in s, error in J², processor seconds for all of SECONDS)."""
    points = [
        Point(Cell(dt, engine=engine), 1, {NORM: ErrorBar.of([error])}, {}, {}, 0.0, Spread.of([1e3 * spent / SECONDS]))
        for dt, error, spent in rows
    ]
    return Curve(f"{engine}, published", points[::-1])


# fmt: off
BOUNCING = [
    _curve("RaiSim", (1e-5, 1.86e-10, 23.7), (1e-4, 1.86e-6, 2.37), (1e-3, 0.0186, 0.235), (1e-2, 186.0, 0.025),
           (0.1, 1.83e6, 0.0027)),
    _curve("ODE", (1e-5, 0.0185021, 192.0), (1e-4, 1.85054, 19.8), (1e-3, 185.027, 1.89), (1e-2, 18808.3, 0.19),
           (0.1, 2.03e6, 0.021)),
    _curve("Bullet", (1e-5, 7.52, 81.0), (1e-4, 752.0, 8.2), (1e-3, 75245.0, 0.85), (1e-2, 7.41e6, 0.10),
           (0.1, 7.68e8, 0.016)),
    _curve("DART", (1e-5, 7.39, 328.0), (1e-4, 483.0, 31.9), (1e-3, 72274.0, 3.2), (1e-2, 7.38e6, 0.34),
           (0.1, 7.67e8, 0.038)),
]
# fmt: on


def published(scene: str, norm: str) -> list[Curve]:
    """The curves for this scene and norm; none for most scenes."""
    return list(BOUNCING) if (scene, norm) == (SCENE, NORM) else []
