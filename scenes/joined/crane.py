"""A crane lifts a crate, carries it across and lets it down.

It is a trolley on a beam, and a rope that a system shortens and lets out.
"""

from carom import Phase, Physics, RigidBody, Settings, System, Transform, World
from carom.plugins.joints import Distance, Joints, Slider
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.scenes.sizes import real

BEAM = 10.0  # m above the ground
SPAN = 12.0  # m that the trolley may go
ROPE = 8.0  # m at the start
WINCH, TROLLEY = 2.0, 2.0  # m/s
CRATE, MASS = 0.75, 50.0
SHORT = 4.0  # m of the rope while it carries
SECONDS = 20.0
VIEW = ((-4.0, -1.0), (16.0, 12.0))


class Driver(System):
    """Winds up the rope, drives the trolley to the other end, and lets the crate down."""

    phase = Phase.START

    def __init__(self, rope: int, rail: int) -> None:
        super().__init__()
        self.rope, self.rail = rope, rail

    def process(self, dt: float) -> None:
        rope, rail = (self.world.component_for_entity(e, c) for e, c in ((self.rope, Distance), (self.rail, Slider)))
        arrived = self.world.time > SPAN / TROLLEY + (ROPE - SHORT) / WINCH + 4.0
        length = rope.length[1]
        wanted = ROPE if arrived else SHORT
        new = max(wanted, length - WINCH * dt) if length > wanted else min(wanted, length + 0.5 * WINCH * dt)
        if new != length:
            rope.length = 0.0, new
        speed = TROLLEY if length <= SHORT and not arrived else 0.0
        if rail.motor_speed != speed:
            rail.motor_speed = speed


def build(settings: Settings | None = None, seed: int = 0, *, mass: float = MASS) -> World:
    """A crate of ``mass`` on the ground, under the trolley; ``seed`` changes nothing."""
    mass = real(mass, "mass", above=True)
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), Rotation(), Joints(), settings=settings)
    world.create_entity(Transform((6.0, -1.0)), BoxCollider((12.0, 1.0)))
    trolley = world.create_entity(Transform((0.0, BEAM)), RigidBody(mass=20.0), BoxCollider((0.6, 0.2)), Spin())
    rail = world.create_entity(
        Slider(None, trolley, direction=(1.0, 0.0), limits=(0.0, SPAN), motor_speed=0.0, max_force=400.0)
    )
    crate = world.create_entity(Transform((0.0, CRATE)), RigidBody(mass=mass), BoxCollider((CRATE, CRATE)), Spin())
    rope = world.create_entity(Distance(trolley, crate, point_b=(0.0, 2 * CRATE), length=(0.0, ROPE + CRATE)))
    world.add_system(Driver(rope, rail))
    return world
