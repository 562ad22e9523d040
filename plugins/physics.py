"""Physics: the standard group of systems, with spheres and boxes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..framework.plugins.plugin import Plugin
from ..framework.typing import Vector
from ..systems.integration.integrators import STANDARD_INTEGRATORS
from ..systems.simulation import Simulation
from .standard_shapes import standard_shapes

if TYPE_CHECKING:
    from ..framework.world.world import World


class Physics(Plugin):
    """Linear mechanics of spheres and axis-aligned boxes.

    dimensions
        2 or 3; ValueError for others
    gravity
        (d,) m/s^2; 0 for none
    """

    def __init__(self, dimensions: int = 2, gravity: Vector | float = 0) -> None:
        super().__init__("physics")
        if dimensions not in (2, 3):
            raise ValueError(f"Physics: dimensions must be 2 or 3, got {dimensions!r}")
        self.dimensions = dimensions
        self.gravity = gravity
        self.shapes, self.pairs = dict(standard_shapes.shapes), dict(standard_shapes.pairs)
        for name, integrator in STANDARD_INTEGRATORS.items():
            self.integrator(name)(integrator)

    def install(self, world: World) -> None:
        """Give the world its table and its systems; ValueError if it has physics already."""
        simulation = Simulation(world, self.dimensions, self.gravity)
        simulation.check_settings(world.settings)  # the systems read them
        world.take_physics(simulation)
        for system in simulation.systems:
            world.add_system(system)
