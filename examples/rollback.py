"""Two peers of a network game that never wait for each other: python examples/rollback.py

Each peer plays with what it knows: its own inputs at once, those of the other as soon as they arrive. When it is told
what the other did some frames ago, and that is not what it took for it, carom.Rollback goes back there and plays these
frames again, with bullets that are fired in them, in the time of one frame. At the end both have the same world, to the
bit. examples/games/siege.py does this over a network.
"""

from __future__ import annotations

import numpy as np

from carom import (
    AABBCollider,
    Component,
    Phase,
    Physics,
    RigidBody,
    Rollback,
    Settings,
    SphereCollider,
    System,
    Transform,
    World,
    column,
)

DELAY = 8  # frames that an input is under way
FRAMES = 240
NOTHING = (0.0, False)


class Bullet(Component):
    """Lasts until that time of the world."""

    expires: float = column(default=0.0)


class Expire(System):
    """Deletes bullets whose time is over; what it needs to know is in components, so it goes back with the world."""

    phase = Phase.START

    def process(self, dt):
        for entity, bullet in self.world.get_component(Bullet):
            if self.world.time >= bullet.expires:
                self.world.delete_entity(entity)


def new_peer():
    """The world of one of the two, and what plays it."""
    world = World(Physics(dimensions=2, gravity=(0, -9.81)), settings=Settings(max_impacts_per_step=32))
    world.add_system(Expire())
    world.create_entity(Transform((0, -0.5)), AABBCollider((20, 0.5)))
    players = [
        world.create_entity(Transform((x, 0.5)), RigidBody(mass=5), SphereCollider(0.5, friction=0.3)) for x in (-8, 8)
    ]
    for k in range(30):  # a wall between them
        place = (0.8 * (k % 3) - 0.8, 0.4 + 0.8 * (k // 3))
        world.create_entity(Transform(place), RigidBody(), AABBCollider((0.4, 0.4), friction=0.5))

    def act(inputs):
        for player, ahead, (push, fires) in zip(players, (1, -1), inputs, strict=True):
            world.component_for_entity(player, RigidBody).apply_impulse((push, 0))
            if fires:
                x, y = world.component_for_entity(player, Transform).position
                flight = RigidBody(mass=0.2, linear_velocity=(25 * ahead, 3), ccd=True)
                lasts = Bullet(world.time + 0.5)
                world.create_entity(Transform((x + 0.8 * ahead, y + 0.5)), flight, SphereCollider(0.1), lasts)

    return Rollback(world, act, most=DELAY + 1, idle=NOTHING)


def play(frames=FRAMES, delay=DELAY, seed=0):
    """Two peers that press random buttons; every input reaches the other after ``delay`` frames."""
    rng, peers = np.random.default_rng(seed), [new_peer(), new_peer()]
    under_way = []
    for frame in range(frames + delay + 1):
        while under_way and under_way[0][0] <= frame:
            _, number, told = under_way.pop(0)
            peers[1 - number].give(number, *told)
        if frame < frames:
            for number, peer in enumerate(peers):
                told = frame, [(float(rng.normal()), bool(rng.random() < 0.1))]
                peer.give(number, *told)
                peer.step()
                under_way.append((frame + delay, number, told))
    for peer in peers:
        peer.settle()
    return peers


if __name__ == "__main__":
    peers = play()
    hashes = [peer.world.state_hash() for peer in peers]
    assert hashes[0] == hashes[1], "the two worlds differ"
    print(f"{FRAMES} frames, {peers[0].replayed} played again; both worlds: {hashes[0]}")
