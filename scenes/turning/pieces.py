"""L, T and U pieces of several boxes tumble into a bin, hook into each other and rest."""

import numpy as np

from carom import BoxCollider, PartOf, Parts, Physics, RigidBody, Rotation, Settings, Spin, Transform, World
from carom.scenes.bodies import lattice
from carom.scenes.sizes import ceil_root, whole
from carom.scenes.walls import enclose

BODIES = 60
PITCH = 1.5  # m, of the lattice on which they start
FRICTION = 0.6
DENSITY = 4.0  # kg/m^2
# The boxes of each piece, (centre, half extents) in m: the first one is the body's own.
PIECES = (
    (((0.0, 0.0), (0.15, 0.5)), ((0.3, -0.35), (0.15, 0.15))),
    (((0.0, 0.0), (0.5, 0.15)), ((0.0, -0.4), (0.15, 0.25))),
    (((0.0, 0.0), (0.5, 0.15)), ((-0.35, 0.35), (0.15, 0.2)), ((0.35, 0.35), (0.15, 0.2))),
)
WIDTH = PITCH * ceil_root(BODIES, 2)  # of the bin for that many
SECONDS = 10.0
VIEW = ((-1.0, -1.0), (WIDTH + 1.0, WIDTH + 2.0))


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES, friction: float = FRICTION) -> World:
    """``n`` bodies, one of each shape after the other; ``seed`` chooses their angles, velocities and spins."""
    n, parts = whole(n, "n"), Parts()
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), Rotation(), parts, settings=settings)
    side = ceil_root(n, 2)
    enclose(world, (0.0, 0.0), (PITCH * side, 1.5 * (PITCH * side)), friction=friction, open_top=True)
    random = np.random.default_rng(seed)
    for k, place in enumerate((lattice(n, side) + 0.5) * PITCH):
        own, *others = PIECES[k % len(PIECES)]
        body = world.create_entity(
            Transform(place, random.uniform(0.0, 2.0 * np.pi)),
            RigidBody(mass=_mass(own), linear_velocity=random.uniform(-1.0, 1.0, 2)),
            Spin(random.uniform(-2.0, 2.0)),
            BoxCollider(own[1], friction=friction),
        )
        for box in others:
            world.create_entity(PartOf(body, box[0], mass=_mass(box)), BoxCollider(box[1], friction=friction))
        parts.balance(body)
    return world


def _mass(box: tuple[tuple[float, float], tuple[float, float]]) -> float:
    return DENSITY * 4.0 * box[1][0] * box[1][1]
