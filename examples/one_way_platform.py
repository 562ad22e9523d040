"""A platform to jump through from below, to stand on, and to drop through: python examples/one_way_platform.py"""

from __future__ import annotations

from carom import AABBCollider, Physics, RigidBody, Transform, World

PLATFORMS = 2  # a layer


def main():
    world = World(Physics(dimensions=2, gravity=(0, -20)))
    platform = AABBCollider((2, 0.25), one_way=(0, 1), layer=PLATFORMS)
    names = {
        world.create_entity(Transform((0, -0.5)), AABBCollider((20, 0.5))): "floor",
        world.create_entity(Transform((0, 1.75)), platform): "platform",
    }
    player = world.create_entity(Transform((0, 0.5)), RigidBody(), AABBCollider((0.4, 0.5)))
    transform, body, collider = (
        world.component_for_entity(player, kind) for kind in (Transform, RigidBody, AABBCollider)
    )

    def tell(what):
        below = [names[contact.entity_b] for contact in world.contacts.of(player) if contact.normal[1] < -0.7]
        where = f"stands on the {below[0]}" if below else "is in the air"
        print(f"{world.time:4.2f} s  y = {transform.y:4.2f}  {what}: the player {where}")

    world.advance(0.1)
    tell("at the start")
    body.linear_velocity = (0, 12)
    for _ in range(4):
        world.advance(0.1)
        tell("jumps")
    while body.linear_velocity[1] or transform.y > 2.6:
        world.advance(0.1)
    tell("has landed")
    collider.mask = ~PLATFORMS
    world.advance(0.1)
    collider.mask = -1  # what has begun to pass passes
    tell("drops")
    for _ in range(10):
        world.advance(0.1)
    tell("has dropped")


if __name__ == "__main__":
    main()
