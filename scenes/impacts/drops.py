"""A ball bounces on the floor, to 0.64 of its height each time.

It falls from 4.9 m. With restitution e the apex after n bounces is 4.9 e^(2n) m. The first impact is at
T = sqrt(2 h / g), about 1 s, the n-th at T (1 + 2 e (1 - e^(n - 1)) / (1 - e)). The limit for infinitely many is
T (1 + e) / (1 - e): 9 s if e = 0.8.
"""

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.scenes.sizes import real
from carom.scenes.walls import block

HEIGHT = 4.9  # metres, of the lowest point of the ball
RADIUS = 0.1
RESTITUTION = 0.8
GRAVITY = 9.81
SETTINGS = Settings(integrator="velocity_verlet", collision="continuous")
SECONDS = 5.0
VIEW = ((-2.5, -0.5), (2.5, 5.5))


def build(settings: Settings | None = None, seed: int = 0, *, restitution: float = RESTITUTION) -> World:
    """A ball of 1 kg, initially at rest; ``restitution`` applies to ball and floor; ``seed`` changes nothing."""
    restitution = real(restitution, "restitution")
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), settings=settings or SETTINGS)
    block(world, (-5.0, -5.0), (5.0, 0.0), restitution=restitution)
    world.create_entity(
        Transform((0.0, HEIGHT + RADIUS)), RigidBody(mass=1.0), SphereCollider(RADIUS, restitution=restitution)
    )
    return world
