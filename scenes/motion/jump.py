"""A hero jumps over a wall: apex 64 pixels, four tiles.

The jump of a platform game at 60 Hz: 4 pixels a frame upwards against 0.125 pixels a frame squared of gravity. Its
exact apex is v0^2 / 2g = 64 pixels, four tiles of 16; the hero clears a wall three tiles high and lands 96
pixels further on. The integrators differ in the apex (explicit Euler 66, semi-implicit Euler 62,
velocity Verlet 64), so try ``--set integrator=explicit_euler`` and ``--set dt=1/30``.
"""

from carom import AABBCollider, Physics, RigidBody, Settings, Transform, World

TILE = 16.0  # pixels, the unit of length here
JUMP_SPEED = 4.0 * 60  # pixels/s
GRAVITY = 0.125 * 60**2  # pixels/s^2
RUN_SPEED = 1.5 * 60  # pixels/s: 96 pixels during the 64 frames of the jump
HALF_WIDTH, HALF_HEIGHT = 6.0, 8.0
SETTINGS = Settings(integrator="velocity_verlet")
SECONDS = 1.25
VIEW = ((-2 * TILE, -TILE), (9 * TILE, 6 * TILE))


def build(settings: Settings | None = None, seed: int = 0) -> World:
    """The hero has just left the ground, feet at height 0, centre at (0, 8); ``seed`` changes nothing."""
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), settings=settings or SETTINGS)
    world.create_entity(Transform((6 * TILE, -TILE / 2)), AABBCollider(half_extents=(10 * TILE, TILE / 2)))
    for height in range(3):
        world.create_entity(
            Transform((3 * TILE, (height + 0.5) * TILE)), AABBCollider(half_extents=(TILE / 2, TILE / 2))
        )
    world.create_entity(
        Transform((0.0, HALF_HEIGHT)),
        RigidBody(mass=1.0, linear_velocity=(RUN_SPEED, JUMP_SPEED)),
        AABBCollider(half_extents=(HALF_WIDTH, HALF_HEIGHT)),
    )
    return world
