"""A crowd runs at a player who walks in a circle and fires in all directions: carom trade examples/games/survivors.py

Enemies push each other, bullets hit one enemy each, and every enemy that dies is replaced at the edge.
"""

from __future__ import annotations

import numpy as np

from carom import Component, Phase, Physics, RigidBody, SphereCollider, System, Transform, World, column

ENEMIES, BULLETS = 2000, 600.0  # at once; a second
PLAYER, ENEMY, BULLET = 1, 2, 4  # layers
EDGE = 60.0  # m from the player: enemies start here at the farthest
SPEED, BULLET_SPEED, RANGE = 6.0, 40.0, 0.8  # m/s, m/s, s

seconds = 4.0


class Enemy(Component):
    """Runs at the player."""

    health: int = column(default=5, dtype=int)


class Bullet(Component):
    """Flies until that time of the world."""

    expires: float = column(default=0.0)


class Game(System):
    """Moves the player, steers the enemies, fires and spawns: all by the time of the world, not by steps."""

    phase = Phase.START

    def __init__(self, seed):
        super().__init__()
        self.random = np.random.default_rng(seed)
        self.fired = self.kills = self.hits = 0

    def process(self, dt):
        world, bodies = self.world, self.world.bodies
        player = bodies.position[bodies.row_of(self.player)]
        angle = 0.5 * world.time
        bodies.linear_velocity[bodies.row_of(self.player)] = 4 * np.cos(angle), 4 * np.sin(angle)
        dynamic = bodies.dynamic
        enemies = dynamic.has(Enemy)
        way = player - dynamic.position[enemies]
        dynamic.linear_velocity[enemies] = SPEED * way / np.linalg.norm(way, axis=1, keepdims=True)
        due = int(BULLETS * (world.time + dt)) - self.fired
        self.fired += due
        nose = self.random.uniform(0, 2 * np.pi, due)
        for direction in np.stack([np.cos(nose), np.sin(nose)], axis=1):
            world.create_entity(
                Transform(player + direction),
                RigidBody(0.01, BULLET_SPEED * direction),
                SphereCollider(0.15, sensor=True, layer=BULLET, mask=ENEMY),
                Bullet(world.time + RANGE),
            )


class Rules(System):
    """Five bullets kill, contacts hurt, and who dies is replaced."""

    def process(self, dt):
        world, game = self.world, self.world.get_processor(Game)
        gone = set()
        for bullet, enemy, _ in world.contacts.begin.pairs(Bullet, Enemy):
            if {bullet, enemy} & gone:
                continue
            gone.add(bullet)
            state = world.component_for_entity(enemy, Enemy)
            state.health -= 1
            if state.health <= 0:
                gone.add(enemy)
                game.kills += 1
                spawn(world, game)
        game.hits += sum(1 for _ in world.contacts.begin.pairs(Player, Enemy))
        gone |= {entity for entity, bullet in world.get_component(Bullet) if bullet.expires <= world.time}
        for entity in gone:
            world.delete_entity(entity)


class Player(Component):
    """Whom they run at."""


def spawn(world, game, nearest=EDGE - 10):
    angle, distance = game.random.uniform(0, 2 * np.pi), game.random.uniform(nearest, EDGE)
    where = distance * np.array([np.cos(angle), np.sin(angle)])
    world.create_entity(
        Transform(where), RigidBody(), SphereCollider(0.5, layer=ENEMY, mask=PLAYER | ENEMY | BULLET), Enemy()
    )


def build(settings, seed=0, enemies=ENEMIES):
    world, game = World(Physics(dimensions=2, gravity=(0, 0)), settings=settings), Game(seed)
    world.add_system(game)
    world.add_system(Rules())
    body = RigidBody(kind="kinematic")
    game.player = world.create_entity(Transform((0, 0)), body, SphereCollider(0.5, layer=PLAYER, mask=ENEMY), Player())
    for _ in range(enemies):
        spawn(world, game, nearest=6)
    return world


def compared(world):
    """What carom trade compares."""
    game = world.get_processor(Game)
    return {"kills": game.kills, "hits": game.hits}
