"""A disc strikes another off centre: one impact, known in round numbers.

The first comes from (-3, 0.6) at 1 m/s along x, the second is at rest at the origin. Both have radius 0.5, so they
touch after 2.2 s, when the first is at (-0.8, 0.6); the impact's normal is (0.8, -0.6). Equal masses and restitution 1
give the velocities (0.36, 0.48) and (0.64, -0.48), and after 3 s the positions (-0.512, 0.984) and (0.512, -0.384).
"""

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.scenes.sizes import real

RADIUS = 0.5
START = (-3.0, 0.6)
SPEED = 1.0
SETTINGS = Settings(collision="continuous")
SECONDS = 3.0
VIEW = ((-4.0, -2.0), (2.0, 2.0))


def build(settings: Settings | None = None, seed: int = 0, *, mass: float = 1.0, restitution: float = 1.0) -> World:
    """A disc of 1 kg hits one of ``mass`` kg; ``restitution`` of both. ``seed`` changes nothing."""
    mass, restitution = real(mass, "mass", above=True), real(restitution, "restitution")
    world = World(Physics(dimensions=2), settings=settings or SETTINGS)
    for position, speed, kilograms in ((START, SPEED, 1.0), ((0.0, 0.0), 0.0, mass)):
        world.create_entity(
            Transform(position),
            RigidBody(mass=kilograms, linear_velocity=(speed, 0.0)),
            SphereCollider(radius=RADIUS, restitution=restitution),
        )
    return world
