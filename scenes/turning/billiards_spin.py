"""Follow, stop and draw: what spin does to a cue ball.

Seen from the side: on three tables a cue ball meets another one, each with its own spin. The cue ball hands its
velocity on, and keeps its spin, because balls rub on the cloth only. So with top spin it follows the other one, without
spin it stays, and with back spin it comes back. Both roll without sliding in the end. On the table of ``billiards``,
which is seen from above, nothing rolls: a plane has no cloth below it.
"""

import numpy as np

from carom import Physics, RigidBody, Rotation, Settings, SphereCollider, Spin, Transform, World
from carom.scenes.impacts.billiards import MASS, RADIUS
from carom.scenes.sizes import real
from carom.scenes.walls import block

SPEED = 1.5  # m/s
FRICTION = 0.2  # of a ball on the cloth
SPINS = {"follow": -1.0, "stop": 0.0, "draw": 1.0}  # in speeds over radius; -1: it rolls
SHELF = 0.2  # from one table to the next
LENGTH, THICKNESS = (-0.5, 1.5), 0.02
GAP = 1e-3
SETTINGS = Settings(dt=1 / 480)
SECONDS = 1.2
VIEW = ((LENGTH[0], -2.3 * SHELF), (LENGTH[1], 0.8 * SHELF))


def build(settings: Settings | None = None, seed: int = 0, *, speed: float = SPEED) -> World:
    """The cue balls have ``speed`` and have all but reached the others; ``seed`` changes nothing.

    Created in this order, from the upper table to the lower one: table, cue ball, the other ball.
    """
    speed = real(speed, "speed")
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), Rotation(), settings=settings or SETTINGS)
    for k, spin in enumerate(SPINS.values()):
        cloth = -k * SHELF
        block(world, (LENGTH[0], cloth - THICKNESS), (LENGTH[1], cloth), friction=FRICTION)
        for place, share in ((0.0, 1.0), (2 * RADIUS + GAP, 0.0)):
            world.create_entity(
                Transform((place, cloth + RADIUS)),
                RigidBody(mass=MASS, linear_velocity=np.array((share * speed, 0.0))),
                Spin(share * spin * speed / RADIUS, inertia=0.4 * MASS * RADIUS**2),  # of a ball, not of a disc
                SphereCollider(RADIUS, restitution=1.0),  # friction None: that of the cloth, and none between balls
            )
    return world
