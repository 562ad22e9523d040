"""A ball falls from 4.9 m and bounces lower each time, until it rests on the floor.

With restitution e the apex after n bounces is 4.9 e^(2n) m. The first impact is at T = sqrt(2 h / g), about 1 s, the
n-th at T (1 + 2 e (1 - e^(n - 1)) / (1 - e)). The limit for infinitely many is T (1 + e) / (1 - e): 9 s if e = 0.8.
"""

from __future__ import annotations

from ...components import RigidBody, SphereCollider, Transform
from ...framework import Settings, World
from ...plugins import Physics
from ..protocol import Scene
from ..sizes import real
from ..walls import block

HEIGHT = 4.9  # metres, of the lowest point of the ball
RADIUS = 0.1
RESTITUTION = 0.8
GRAVITY = 9.81

SETTINGS = Settings.balanced().replace(integrator="velocity_verlet", collision="continuous")


def build(settings: Settings | None = None, seed: int = 0, *, restitution: float = RESTITUTION) -> World:
    """A ball of 1 kg, initially at rest; ``restitution`` applies to ball and floor; ``seed`` changes nothing."""
    restitution = real(restitution, "restitution")
    settings = settings or SETTINGS
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), settings=settings)
    block(world, (-5.0, -5.0), (5.0, 0.0), restitution=restitution)
    world.create_entity(
        Transform((0.0, HEIGHT + RADIUS)), RigidBody(mass=1.0), SphereCollider(RADIUS, restitution=restitution)
    )
    return world


SCENE = Scene(
    name="drops",
    description="a ball bounces on the floor, to 0.64 of its height each time",
    build=build,
    seconds=5.0,
    view=((-2.5, -0.5), (2.5, 5.5)),
    settings=SETTINGS,
)
