"""Fast balls in six lanes, which tell the kinds of collision apart.

Each ball moves two metres in a step of 1/60 s and is half a metre wide. All shapes are elastic and there is no gravity,
so the exact position of every ball is known. From the top:

- graze: a ball touches the edge of a post between two steps.
- wall: a ball and a wall a tenth of a metre thick.
- head on: two balls that are past each other when the step ends.
- ghost: a target behind a shield. At the end of a step the free path of the ball is inside the target, which the shield
  prevents it from reaching.
- pace: two balls of the same speed to the right, one of them to and fro between two plates, which it hits twice in
  a step. Neither gets ahead, unless a body that meets something loses the rest of its step.

Try ``--set collision=discrete``, and ``--set max_impacts_per_step=1`` for the last lane.
"""

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.scenes.walls import block

START = 1.0  # x of balls that come from the left
SPEED = 120.0
RADIUS = 0.25
THICKNESS = 0.1

GRAZE, WALL, HEAD_ON, GHOST, FREE, PLATES = 9.5, 7.5, 5.7, 3.7, 1.7, 0.0  # heights of the lanes
POST, POST_RADIUS, OFF_CENTRE = 8.0, 0.5, 0.72  # the contact normal is (7, 24) / 25
WALL_FACE = 7.95
OPPOSITE = 15.0  # where the ball from the right starts
SHIELD_FACE, TARGET, TARGET_RADIUS = 7.55, 9.4, 0.5
REACH = 0.6  # extent of walls and shields above and below the lane
APART = 1.5  # distance of the plates
END = 16.0
SETTINGS = Settings(collision="continuous")
SECONDS = 0.1
VIEW = ((0.0, -1.2), (END, 12.9))


def build(settings: Settings | None = None, seed: int = 0) -> World:
    """Lanes from the top, in each the static shapes first, then the balls from the left; ``seed`` changes nothing."""
    world = World(Physics(dimensions=2), settings=settings or SETTINGS)

    def ball(x: float, y: float, *velocity: float, radius: float = RADIUS) -> None:
        body = RigidBody(mass=1.0, linear_velocity=velocity)
        world.create_entity(Transform((x, y)), body, SphereCollider(radius, restitution=1.0))

    def wall(x: float, y: float) -> None:
        block(world, (x, y - REACH), (x + THICKNESS, y + REACH), restitution=1.0)

    world.create_entity(Transform((POST, GRAZE - OFF_CENTRE)), SphereCollider(POST_RADIUS, restitution=1.0))
    ball(START, GRAZE, SPEED, 0.0)
    wall(WALL_FACE, WALL)
    ball(START, WALL, SPEED, 0.0)
    ball(START, HEAD_ON, SPEED, 0.0)
    ball(OPPOSITE, HEAD_ON, -SPEED, 0.0)
    wall(SHIELD_FACE, GHOST)
    ball(START, GHOST, SPEED, 0.0)
    ball(TARGET, GHOST, 0.0, 0.0, radius=TARGET_RADIUS)
    ball(START, FREE, SPEED, 0.0)
    for low in (PLATES - APART / 2 - THICKNESS, PLATES + APART / 2):
        block(world, (0.0, low), (END, low + THICKNESS), restitution=1.0)
    ball(START, PLATES, SPEED, -SPEED)
    return world
