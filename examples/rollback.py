"""Two peers of a network game that never wait for each other: python examples/rollback.py

Each peer plays with what it knows: its own inputs at once, those of the other as soon as they arrive. It keeps a
snapshot of every frame of the last ones. When it is told what the other did some frames ago, it goes back there and
plays these frames again, with bullets that are fired in them, in the time of one frame. At the end both have the same
world, to the bit.
"""

from __future__ import annotations

import numpy as np

from carom import (
    AABBCollider,
    Component,
    Phase,
    Physics,
    RigidBody,
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


class Peer:
    """One of two players, number 0 or 1, with a world of its own."""

    def __init__(self, number):
        self.number, self.frame, self.replayed = number, 0, 0
        self.inputs = {}  # by frame and player
        self.snapshots = {}  # by frame, before it was played
        self.world = World(Physics(dimensions=2, gravity=(0, -9.81)), settings=Settings(max_impacts_per_step=32))
        self.world.add_system(Expire())
        self.world.create_entity(Transform((0, -0.5)), AABBCollider((20, 0.5)))
        self.players = [
            self.world.create_entity(Transform((x, 0.5)), RigidBody(mass=5), SphereCollider(0.5, friction=0.3))
            for x in (-8, 8)
        ]
        for k in range(30):  # a wall between them
            place = (0.8 * (k % 3) - 0.8, 0.4 + 0.8 * (k // 3))
            self.world.create_entity(Transform(place), RigidBody(), AABBCollider((0.4, 0.4), friction=0.5))

    def play(self, push, fires):
        """One frame with this player's input; returns what the other is to be told."""
        self.inputs[self.frame, self.number] = (push, fires)
        self._play_frame()
        return self.frame - 1, self.number, (push, fires)

    def hear(self, frame, player, given):
        """The other's input of a frame that is over: go back, and play forward again."""
        self.inputs[frame, player] = given
        now, self.frame = self.frame, frame
        self.world.restore(self.snapshots[frame])
        for known in [known for known in self.snapshots if known < frame]:
            del self.snapshots[known]
        while self.frame < now:
            self._play_frame()
            self.replayed += 1

    def _play_frame(self):
        self.snapshots[self.frame] = self.world.snapshot()
        for number in range(2):
            self._act(number, *self.inputs.get((self.frame, number), NOTHING))
        self.world.step()
        self.frame += 1

    def _act(self, number, push, fires):
        world, player = self.world, self.players[number]
        body = world.component_for_entity(player, RigidBody)
        body.apply_impulse((push, 0))
        if fires:
            ahead = 1 if number == 0 else -1
            x, y = world.component_for_entity(player, Transform).position
            flight = RigidBody(mass=0.2, linear_velocity=(25 * ahead, 3), ccd=True)
            lasts = Bullet(world.time + 0.5)
            world.create_entity(Transform((x + 0.8 * ahead, y + 0.5)), flight, SphereCollider(0.1), lasts)


def play(frames=FRAMES, delay=DELAY, seed=0):
    """Two peers that press random buttons; every input reaches the other after ``delay`` frames."""
    rng, peers = np.random.default_rng(seed), [Peer(0), Peer(1)]
    under_way = []
    for frame in range(frames + delay):
        while under_way and under_way[0][0] <= frame:
            _, told = under_way.pop(0)
            peers[1 - told[1]].hear(*told)
        if frame < frames:
            for peer in peers:
                told = peer.play(float(rng.normal()), bool(rng.random() < 0.1))
                under_way.append((frame + delay, told))
    for _, told in under_way:
        peers[1 - told[1]].hear(*told)
    return peers


if __name__ == "__main__":
    peers = play()
    hashes = [peer.world.state_hash() for peer in peers]
    assert hashes[0] == hashes[1], "the two worlds differ"
    print(f"{FRAMES} frames, {peers[0].replayed} played again; both worlds: {hashes[0]}")
