"""Swarm: stand against a horde, grow stronger, kill its queen: python examples/games/swarm.py

Arrows or WASD run, space throws all back, 1, 2 and 3 choose what to improve. The game aims and fires by itself.
All that happens is in components and timers, so that snapshots, files and replays hold it. What moves in hundreds is
made, steered, hit and deleted as columns; there is no loop over enemies or bullets.
"""

from __future__ import annotations

import gc
from math import atan2, exp, hypot, pi
from pathlib import Path

import numpy as np

from carom import Component, Phase, Physics, RigidBody, SphereCollider, System, Transform, World, column
from carom.lab import Inputs
from carom.plugins.timers import Timer, Timers
from carom.plugins.zones import Zones, explode
from carom.view import Camera

HERO, ENEMY, BULLET = 1, 2, 4  # layers
GRUB, RUNNER, BRUTE, QUEEN = range(4)
RADIUS = np.array((0.38, 0.3, 0.75, 2.2))  # m
HEALTH = np.array((3, 2, 24, 60))  # of the queen, for each wave; others get more by waves
SPEED = np.array((3.6, 6.2, 2.6, 4.2))  # m/s
MASS = np.array((1.0, 0.6, 8.0, 300.0))  # kg
WORTH = np.array((1, 1, 8, 0))  # of its gem
MOST, FASTEST = 2000, 600.0  # enemies; bullets a second
KEYS = ("left", "right", "up", "down", "space", "1", "2", "3")
OTHERS = {"a": "left", "d": "right", "w": "up", "s": "down"}
CHOICES = ("fire faster", "hit harder", "heal, and run faster")
RECORDED = Path(__file__).with_name("swarm.keys")
ENDS = {"over": ("OVERRUN", (240, 90, 100)), "won": ("THE SWARM IS NO MORE", (140, 230, 120))}

seconds = 20.0


class Game(Component):
    """What is no body: one entity has it, with the timer of the waves."""

    state: str = column(default="title", choices=("title", "play", "over", "won"))
    hero: int = column(default=-1, dtype=int)
    seed: int = column(default=0, dtype=int)
    held: int = column(default=0, dtype=int)  # the keys of the last step, as bits
    wave: int = column(default=0, dtype=int)
    waves: int = column(default=20, dtype=int)  # with the last one the queen comes
    came: int = column(default=0, dtype=int)  # how often enemies have come: what draws their places
    seconds: float = column(default=0.0)  # played
    health: float = column(default=100.0)
    speed: float = column(default=5.0)  # m/s
    rate: float = column(default=12.0)  # bullets a second
    damage: int = column(default=1, dtype=int)
    shots: float = column(default=0.0)  # bullets fired, and a part of the next
    kills: int = column(default=0, dtype=int)
    gems: int = column(default=0, dtype=int)
    level: int = column(default=1, dtype=int)
    choices: int = column(default=0, dtype=int)  # improvements to choose


class Enemy(Component):
    """Runs at the hero."""

    kind: int = column(default=GRUB, dtype=int)
    health: int = column(default=1, dtype=int)


class Bullet(Component):
    """Hits one enemy."""


class Gem(Component):
    """Flies to the hero."""

    worth: int = column(default=1, dtype=int)


class Fades(Component):
    """Is there until that time of the world."""

    until: float = column(default=0.0)


def needed(level):
    """How many gems the next level takes."""
    return 7 * level * (level + 1) // 2


class Act(System):
    """Before each step: keys, the hero, enemies, bullets and gems."""

    phase = Phase.START

    def __init__(self, keys=None):
        super().__init__()
        self.keys, self.held = keys, frozenset()  # the window, or play, writes what is held

    def process(self, dt):
        ((entity, game),) = self.world.get_component(Game)
        held = self.held if self.keys is None else self.keys.held(self.world.time, dt)
        bits = sum(1 << k for k, name in enumerate(KEYS) if name in held)
        pressed = {name for k, name in enumerate(KEYS) if bits & ~game.held & 1 << k}
        game.held = bits
        if game.state == "title" and "space" in pressed:
            game.state = "play"
            self.world.add_component(entity, Timer(5.0, repeat=True))
            next_wave(self.world, game)
        elif game.state == "play":
            game.seconds += dt
            place = self.run(game, held, pressed)
            self.steer(place, dt)
            self.fire(game, place, dt)
        elif game.state in ENDS:
            self.world.bodies.linear_velocity[:] = 0.0

    def run(self, game, held, pressed):
        if game.choices and pressed & {"1", "2", "3"}:
            game.choices -= 1
            if "1" in pressed:
                game.rate = min(1.35 * game.rate, FASTEST)
            elif "2" in pressed:
                game.damage += 1
            else:
                game.health, game.speed = min(game.health + 40.0, 100.0), min(game.speed + 0.4, 9.0)
        transform, body = self.world.try_components(game.hero, Transform, RigidBody)
        x, y = ("right" in held) - ("left" in held), ("up" in held) - ("down" in held)
        body.linear_velocity = game.speed * np.array((x, y)) / max(hypot(x, y), 1.0)
        if "space" in pressed and not self.world.has_component(game.hero, Timer):
            explode(self.world, transform.position, radius=9.0, impulse=14.0, mask=ENEMY)
            self.world.add_component(game.hero, Timer(4.0))
        return transform.position.copy()

    def steer(self, place, dt):
        """Enemies turn to the hero and from each other; gems that are near enough fly to the hero."""
        bodies = self.world.bodies
        enemies = bodies.dynamic  # all that is dynamic is an enemy
        if len(enemies):
            way = place - enemies.position
            wish = SPEED[enemies.enemy.kind][:, None] * way / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
            asker, other = self.world.neighbours(1.0, of=enemies.entity, mask=ENEMY).pairs()
            apart = bodies.position[asker] - bodies.position[other]
            for axis in range(2):
                wish[:, axis] += 2.0 * np.bincount(asker, apart[:, axis], len(enemies))
            enemies.linear_velocity[:] += (1.0 - exp(-5.0 * dt)) * (wish - enemies.linear_velocity)
        things = bodies.kinematic
        gems = np.flatnonzero(things.has(Gem))
        way = place - things.position[gems]
        far = np.maximum(np.hypot(*way.T), 0.1)
        flies = (far < 4.5) | (np.abs(things.linear_velocity[gems]).sum(axis=1) > 0)
        things.linear_velocity[gems[flies]] = 14.0 * way[flies] / far[flies, None]

    def fire(self, game, place, dt):
        nearest = self.world.query_nearest(place, mask=ENEMY, max_distance=25.0)
        before, game.shots = int(game.shots), game.shots + game.rate * dt
        numbers = np.arange(before, int(game.shots))
        if nearest is None or not len(numbers):
            return
        aim = atan2(*(nearest.point - place)[::-1])
        spread = pi * (game.rate / FASTEST) ** 0.5  # at last all around
        angle = aim + spread * (2.0 * (numbers * 0.6180339887498949 % 1.0) - 1.0)
        way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        self.world.create_entities(
            len(numbers), Transform.many(place + 0.6 * way), Bullet.many(), Fades.many(until=self.world.time + 0.8),
            RigidBody.many(kind="kinematic", linear_velocity=24.0 * way),
            SphereCollider.many(radius=0.16, sensor=True, layer=BULLET, mask=ENEMY),
        )  # fmt: skip


class Harvest(System):
    """After each step: hits, deaths, gems, harm, and the end."""

    def process(self, dt):
        world, game = self.world, game_of(self.world)
        if game.state != "play":
            return
        bodies = world.bodies
        fading = bodies.has(Fades)
        world.delete_entities(bodies.entity[fading][bodies.fades.until[fading] <= world.time])
        self.hit(game)
        place = world.component_for_entity(game.hero, Transform).position
        gems = np.flatnonzero(bodies.has(Gem))
        taken = gems[np.hypot(*(bodies.position[gems] - place).T) < 0.7]
        game.gems += int(bodies.gem.worth[taken].sum())
        world.delete_entities(bodies.entity[taken])
        while game.gems >= needed(game.level):
            game.level += 1
            game.choices += 1
        game.health -= 5.0 * dt * min(len(world.contacts.of(game.hero)), 8)
        if game.health <= 0.0:
            game.state = "over"

    def hit(self, game):
        """Each new touch of a bullet and an enemy; of several in one step the first counts for the bullet."""
        world, bodies = self.world, self.world.bodies
        found = world.contacts.begin.between(Bullet, Enemy)
        bullets, first = np.unique(found.a, return_index=True)
        world.delete_entities(bullets)
        rows = bodies.rows_of(found.b[first])
        np.subtract.at(bodies.enemy.health, rows, game.damage)
        rows = np.unique(rows)
        dead = rows[bodies.enemy.health[rows] <= 0]
        kinds, places = bodies.enemy.kind[dead], bodies.position[dead]
        game.kills += len(dead)
        world.delete_entities(bodies.entity[dead])
        world.create_entities(
            len(dead), Transform.many(places), RigidBody.many(kind="kinematic"), Gem.many(worth=WORTH[kinds]),
            Fades.many(until=world.time + 15.0),
        )  # fmt: skip
        if (kinds == QUEEN).any():
            game.state = "won"


def come(world, game, kinds):
    """Enemies of these ``kinds``, (n,), in a ring around the hero; no more than MOST in all."""
    kinds = kinds[: max(MOST - len(world.bodies.dynamic), 0)]
    game.came += 1
    random, n = np.random.default_rng((game.seed, game.came)), len(kinds)
    angle, far = random.uniform(0, 2 * pi, n), random.uniform(21.0, 34.0, n)  # beyond what is seen
    place = world.component_for_entity(game.hero, Transform).position
    world.create_entities(
        n, Transform.many(place + far[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)),
        RigidBody.many(mass=MASS[kinds]),
        SphereCollider.many(radius=RADIUS[kinds], friction=0.0, layer=ENEMY, mask=HERO | ENEMY | BULLET),
        Enemy.many(kind=kinds, health=HEALTH[kinds] * np.where(kinds == QUEEN, game.waves, 1) + game.wave**2 // 12),
    )  # fmt: skip


def next_wave(world, game):
    if game.state == "play":
        game.wave += 1
        counts = (int(game.wave == game.waves), game.wave // 2, game.wave**2, 20 + 4 * game.wave**2)
        come(world, game, np.repeat((QUEEN, BRUTE, RUNNER, GRUB), counts))


def build(settings=None, seed=0, keys=RECORDED, waves=20):
    """A world; ``keys``: a file of recorded keys that plays it, or None: what is held is told to its system Act."""
    world = World(Physics(dimensions=2, gravity=0), Timers(), Zones(), settings=settings)
    world.register(Enemy, Bullet, Gem, Fades)
    body, shape = RigidBody(kind="kinematic"), SphereCollider(0.45, layer=HERO, mask=ENEMY)
    hero = world.create_entity(Transform((0, 0)), body, shape)
    entity = world.create_entity(Game(hero=hero, seed=seed, waves=waves))
    world.add_system(Act(keys and Inputs.read(keys)))
    world.add_system(Harvest())
    world.on("timer", lambda owner, timer: owner == entity and next_wave(world, game_of(world)))
    return world


def game_of(world):
    return world.get_component(Game)[0][1]


def play(frames, world=None, **how):
    """Steps a world, by default a new one, once with each set of keys; returns it."""
    world = world or build(keys=None, **how)
    for world.get_processor(Act).held in frames:
        world.step()
    return world


def compared(world):
    """What carom trade compares."""
    game = game_of(world)
    return {"kills": game.kills, "gems": game.gems, "health": game.health}


class Pictures:
    """Draws a world; sprites of all that is many come as columns, and go to the screen in one ``fblits``."""

    def __init__(self):
        global pygame  # only pictures need it
        import pygame

        pygame.display.init()  # not pygame.init(), which opens the sound card
        pygame.font.init()
        pygame.display.set_caption("Swarm")
        self.screen = pygame.display.set_mode((1280, 720))
        self.camera = Camera((1280, 720), scale=24.0)
        self.fonts = [pygame.font.Font(None, size) for size in (28, 44, 120)]
        self.ground = pygame.Surface((480, 480)).convert()
        self.ground.fill((34, 40, 36))
        for x, y, size in np.random.default_rng(7).integers((0, 0, 2), (480, 480, 9), (160, 3)).tolist():
            pygame.draw.ellipse(self.ground, ((40, 47, 42), (29, 34, 31))[size % 2], (x, y, 3 * size, size))
        tints = ((106, 190, 92), (240, 176, 62), (150, 96, 200), (226, 62, 92))
        self.enemies = [
            self.creature(tints[k], RADIUS[k], side, step) for k in range(4) for side in (-1, 1) for step in (0, 1)
        ]
        self.hero, self.side = [self.creature((90, 170, 250), 0.55, side, 0) for side in (-1, 1)], 1
        self.bullet = self.disc((5, (255, 150, 40)), (3, (255, 236, 150)))
        self.gems = [self.disc((6, (20, 60, 70)), (5, (80, 230, 220)), (2, (220, 255, 250))),
                     self.disc((8, (70, 30, 70)), (7, (240, 110, 240)), (3, (255, 230, 255)))]  # fmt: skip
        self.shade = pygame.Surface((1280, 720), pygame.SRCALPHA)
        self.shade.fill((10, 12, 16, 150))

    def disc(self, *rings):
        surface = pygame.Surface((2 * rings[0][0] + 2,) * 2, pygame.SRCALPHA)
        for radius, colour in rings:
            pygame.draw.circle(surface, colour, surface.get_rect().center, radius)
        return surface.convert_alpha()

    def creature(self, colour, radius, side, step):
        """Round, with feet and eyes that look to one side, drawn large and made small."""
        surface = pygame.Surface((156, 156), pygame.SRCALPHA)
        dark, light = tuple(0.45 * c for c in colour), tuple(min(255, c + 45) for c in colour)
        for tint, x, y, r in (
            (dark, -30, 48 + 7 * step, 18), (dark, 30, 55 - 7 * step, 18), (dark, 0, 0, 65), (colour, 0, 0, 56),
            (light, -13, -18, 25), ("white", 5, -7, 14), ("white", 40, -7, 14), (0, 10, -6, 7), (0, 45, -6, 7),
        ):  # fmt: skip
            pygame.draw.circle(surface, tint, (78 + x * side, 78 + y), r)
        size = round(2.6 * radius * self.camera.scale)
        return pygame.transform.smoothscale(surface, (size, size)).convert_alpha()

    def draw(self, world, seconds):
        bodies, game, screen = world.bodies, game_of(world), self.screen
        places, hero = bodies.interpolated_position, bodies.row_of(game.hero)
        self.camera.follow(places[hero], seconds)
        left, top = (np.array((-1, 1)) * self.camera.middle * self.camera.scale).astype(int) % 480 - 480
        screen.fblits([(self.ground, (x, y)) for x in range(left, 1280, 480) for y in range(top, 720, 480)])
        pixels = self.camera.to_screen(places)
        seen = np.flatnonzero(((pixels > -60) & (pixels < (1340, 780))).all(axis=1))
        enemy = seen[seen < len(bodies.dynamic)]
        enemy, rest = enemy[np.argsort(pixels[enemy, 1])], seen[len(enemy) :]  # what is nearer is drawn later
        gem, bullet = rest[bodies.has(Gem)[rest]], rest[bodies.has(Bullet)[rest]]
        step = (bodies.entity[enemy] + int(world.time * 6)) % 2
        look = 4 * bodies.enemy.kind[enemy] + 2 * (bodies.linear_velocity[enemy, 0] > 0) + step
        self.side = int(np.sign(bodies.linear_velocity[hero, 0])) or self.side
        self.many([self.gems[worth > 1] for worth in bodies.gem.worth[gem].tolist()], pixels[gem])
        self.many([self.enemies[k] for k in look.tolist()], pixels[enemy])
        self.many([self.hero[self.side > 0]], pixels[hero : hero + 1])
        self.many([self.bullet] * len(bullet), pixels[bullet])
        shock = world.try_component(game.hero, Timer)
        if shock is not None and (age := shock.seconds - shock.left(world.time)) < 0.3:
            pygame.draw.circle(screen, (190, 230, 255), pixels[hero], 9.0 * self.camera.scale * age / 0.3, 4)
        self.status(game, bodies.dynamic.enemy.health[bodies.dynamic.enemy.kind == QUEEN])

    def many(self, surfaces, pixels):
        halves = np.array([surface.get_size() for surface in surfaces]).reshape(-1, 2) / 2
        self.screen.fblits(list(zip(surfaces, (pixels - halves).tolist(), strict=True)))

    def text(self, words, font, where, colour=(240, 240, 230)):
        drawn = self.fonts[font].render(words, True, colour)
        self.screen.blit(drawn, drawn.get_rect(center=where))

    def bar(self, part, place, colour):
        x, y, width, height = place
        pygame.draw.rect(self.screen, (16, 18, 24), place)
        pygame.draw.rect(self.screen, colour, (x + 2, y + 2, (width - 4) * min(max(part, 0), 1), height - 4))

    def status(self, game, queens):
        if game.state == "title":
            self.text("SWARM", 2, (640, 216), (250, 210, 90))
            self.text("They come in waves, and their queen comes last.", 1, (640, 300))
            self.text("arrows or WASD: run     space: shock wave     1 2 3: improve", 0, (640, 474))
            return self.text("press space", 1, (640, 546), (150, 220, 250))
        self.screen.blit(self.shade, (0, 0), (0, 0, 1280, 50))
        below = needed(game.level - 1)
        self.bar((game.gems - below) / (needed(game.level) - below), (0, 0, 1280, 14), (80, 220, 210))
        self.bar(game.health / 100.0, (500, 684, 280, 20), (226, 62, 92))
        self.text(f"level {game.level}", 0, (70, 34))
        self.text(f"wave {min(game.wave, game.waves)} of {game.waves}     {game.seconds:.0f} s", 0, (640, 34))
        self.text(f"{game.kills} down", 0, (1200, 34))
        for health in queens:
            self.bar(health / (HEALTH[QUEEN] * game.waves), (340, 58, 600, 16), (226, 62, 92))
        if game.state == "play" and game.choices:
            self.screen.blit(self.shade, (0, 640), (0, 640, 1280, 40))
            words = "         ".join(f"{k + 1}  {name}" for k, name in enumerate(CHOICES))
            self.text(words, 0, (640, 660), (250, 210, 90))
        if game.state in ENDS:
            self.screen.blit(self.shade, (0, 0))
            words, colour = ENDS[game.state]
            self.text(words, 2, (640, 260), colour)
            self.text(f"{game.kills} down in {game.seconds:.0f} s, level {game.level}", 1, (640, 360))
            self.text("press return to play again", 0, (640, 446), (150, 220, 250))


def main():
    pictures, clock, seed = Pictures(), pygame.time.Clock(), 0
    gc.freeze()  # what is there now is never looked through again: that takes 15 ms
    world = build(seed=seed, keys=None)
    while not pygame.event.get((pygame.QUIT,)):
        pygame.event.clear()
        down, tapped = pygame.key.get_pressed(), pygame.key.get_just_pressed()  # the second: also what is up again
        if down[pygame.K_ESCAPE]:
            return
        if down[pygame.K_RETURN] and game_of(world).state in ENDS:
            world.close()
            seed += 1
            world = build(seed=seed, keys=None)
        codes = [(OTHERS.get(name, name), pygame.key.key_code(name)) for name in (*KEYS, *OTHERS)]
        world.get_processor(Act).held = {name for name, code in codes if down[code] or tapped[code]}
        seconds = clock.tick(60) / 1000
        world.advance(seconds)
        pictures.draw(world, seconds)
        pygame.display.flip()


if __name__ == "__main__":
    main()
