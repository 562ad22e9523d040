"""Cave run: through a cave of Tiled to its other end: python examples/games/cave_run.py [--sound]

Arrows or WASD walk and climb, space jumps, higher when it is held, down drops through planks. Crates on the switch hold
the door open; walkers die of boots. A flag is a checkpoint, and saves the game into a file: L goes on from there.
The map says what is where and how it moves, components and events what it means.
"""

from __future__ import annotations

import gc
import sys
from math import pi, sin
from pathlib import Path

import numpy as np

from carom import AABBCollider, Component, Phase, Physics, Settings, System, Transform, World, column, maps
from carom.lab import Inputs
from carom.plugins import convex_polygon, terrain, tile_grid
from carom.plugins.character import Character, Characters, Ladder
from carom.plugins.paths import Paths
from carom.plugins.rotation import BoxCollider, Rotation
from carom.plugins.zones import Zones
from carom.view import Camera, Sprites, View

KEYS = ("left", "right", "up", "down", "space")
OTHERS = {"a": "left", "d": "right", "w": "up", "s": "down"}
MAP, RECORDED = (Path(__file__).with_name(name) for name in ("cave.tmx", "cave_run.keys"))
SAVED = Path.home() / ".cave_run.carom"
ENDS = {"over": ("THE CAVE KEEPS YOU", 1, 200, (240, 90, 100)), "won": ("DAYLIGHT", 1, 200, (140, 230, 120))}
TILE, ROCK, MOSS = 36, (86, 74, 70), (92, 150, 70)  # pixels, colours
seconds = 20.0


class Game(Component):
    """What is no body."""

    state: str = column(default="title", choices=("title", "play", "over", "won"))
    lives: int = column(default=5, dtype=int)
    coins: int = column(default=0, dtype=int)
    seconds: float = column(default=0.0)  # played
    hurt: float = column(default=-9.0)  # when
    x: float = column(default=0.0)  # m, of the last checkpoint
    y: float = column(default=0.0)


class Hero(Component):
    """Has the keys."""


class Walker(Component):
    """Walks, and turns at walls and ledges."""

    way: float = column(default=1.0)


# What has only a name: of these the map says where they are, and touch() what they do.
MARKS = ("Coin", "Checkpoint", "Goal", "Spikes", "Drown", "Lift", "Crate", "Switch", "Door", "Raft", "Mill")
MARKED = [type(name, (Component,), {"__module__": __name__}) for name in MARKS]
Coin, Checkpoint, Goal, Spikes, Drown, Lift, Crate, Switch, Door, Raft, Mill = MARKED
COMPONENTS = (Hero, Walker, *MARKED)


class Act(System):
    """Before each step: keys to wishes; walkers and the door."""

    phase = Phase.START

    def __init__(self, level, keys=None):
        super().__init__()
        self.level = level  # for what is drawn
        self.keys, self.held = keys, frozenset()  # the window, or play, writes what is held

    def process(self, dt):
        world, game = self.world, game_of(self.world)
        held = self.held if self.keys is None else self.keys.held(world.time, dt)
        if game.state == "title" and held:
            game.state = "play"
        if game.state != "play":
            held = ()
        game.seconds += dt * (game.state == "play")
        for _, (hero, transform, _) in world.get_components(Character, Transform, Hero):
            hero.move = 6.0 * (("right" in held) - ("left" in held))
            hero.climb = 4.0 * (("up" in held) - ("down" in held))
            hero.jump, hero.drop = "space" in held, "down" in held
            if transform.y < 0.0:
                die(world)
        for entity, (walker, me, transform) in world.get_components(Walker, Character, Transform):
            edge = transform.x + 0.5 * walker.way, transform.y
            if me.state == "floor" and (me.on_wall or not world.ray_cast(edge, (0, -1), 0.9, exclude=entity)):
                walker.way = -walker.way
            me.move = 1.6 * walker.way
        pressed = len(world.contacts.between(Switch, Crate).rows) + len(world.contacts.between(Switch, Hero).rows)
        for _, (_, collider) in world.get_components(Door, AABBCollider):
            collider.enabled = not pressed


def touch(world, entity, other, normal, speed):
    """A character ran against something, or into a sensor."""
    hero, what = (entity, other) if world.has_component(entity, Hero) else (other, entity)
    if not world.has_component(hero, Hero) or not world.entity_exists(what):
        return
    game = game_of(world)
    if world.has_component(what, Coin):
        game.coins += 1
        world.delete_entity(what)
        world.dispatch_event("sound", 900.0)
    elif any(world.has_component(what, mark) for mark in (Walker, Spikes, Drown)):
        die(world)
    elif world.has_component(what, Checkpoint):
        x, y = world.component_for_entity(what, Transform).position
        if x > game.x + 1.0:
            game.x, game.y = x, y
            world.dispatch_event("saved")
            world.dispatch_event("sound", 600.0)
    elif world.has_component(what, Goal) and game.state == "play":
        game.state = "won"


def land(world, entity, floor, speed):
    """A walker dies of boots."""
    if world.has_component(entity, Hero) and world.has_component(floor, Walker):
        world.delete_entity(floor)
        me = world.component_for_entity(entity, Character)
        me.velocity = me.velocity[0], 12.0
        world.dispatch_event("sound", 300.0)


def die(world):
    game = game_of(world)
    if game.state != "play" or world.time < game.hurt + 0.5:
        return
    game.hurt, game.lives = world.time, game.lives - 1
    if game.lives == 0:
        game.state = "over"
    world.dispatch_event("sound", 150.0)
    for _, (_, me, transform) in world.get_components(Hero, Character, Transform):
        transform.position, me.velocity = (game.x, game.y), (0.0, 0.0)


def plugins():
    shapes = convex_polygon.plugin, terrain.plugin, tile_grid.plugin
    return Physics(dimensions=2, gravity=(0, -30)), Rotation(), Paths(), Characters(), Zones(), *shapes


def with_rules(world, level, keys=None):
    """Systems and handlers, which no file and no snapshot has."""
    world.add_system(Act(level, keys and Inputs.read(keys)))
    for name in ("saved", "sound"):
        world.events.define(name)
    world.on("character_hit", lambda *what: touch(world, *what))
    world.on("landed", lambda *what: land(world, *what))
    world.on("crushed", lambda entity, by: world.has_component(entity, Hero) and die(world))
    return world


def build(settings=None, seed=0, keys=RECORDED):
    """A world; ``keys``: a file of recorded keys that plays it, or None: what is held is told to its system Act."""
    world = World(*plugins(), settings=settings or Settings(integrator="velocity_verlet"))
    level = maps.load(MAP, world, components=COMPONENTS)
    x, y = world.component_for_entity(level.entities["hero"], Transform).position
    world.create_entity(Game(x=x, y=y))
    return with_rules(world, level, keys)


def loaded(path, level):
    """A world that was saved at a checkpoint; the level, for what is drawn, is that of another world of the map."""
    return with_rules(World.load(path, *plugins(), components=(*COMPONENTS, Game)), level)


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
    ((_, (transform, _)),) = world.get_components(Transform, Hero)
    return {"hero": transform.position, "coins": game_of(world).coins, "lives": game_of(world).lives}


class Pictures:
    """A window on a world; tiles, sprites and what is drawn as lines, all by code."""

    def __init__(self, world, **how):
        global pygame  # only pictures need it
        import pygame

        self.world, self.level, self.sprites, self.save = world, world.get_processor(Act).level, Sprites(world), False
        ((_, (place, _)),) = world.get_components(Transform, Hero)
        camera = Camera(middle=place.position, scale=TILE, bounds=((0, 0), self.level.size))
        how |= {"controls": False, "outlines": False, "rewind_megabytes": 0, "title": "Cave run"}
        self.view = View(world, camera=camera, sprites=self.sprites, below=self.below, above=self.above, **how)
        self.fonts, self.side = [pygame.font.Font(None, size) for size in (30, 120)], 1
        self.kinds = np.array([int(picture.rectangle[0]) // 16 for picture in self.level.pictures])
        self.tiles = [self.tile(number, step).convert_alpha() for step in range(4) for number in range(10)]
        self.walkers = [self.creature((196, 92, 84), side) for side in (-1, 1)]
        self.heroes = [self.creature((92, 168, 240), side) for side in (-1, 1)]
        for mark, colours in (
            (Coin, ((150, 110, 30), (250, 210, 80), 99)), (Lift, ((70, 78, 92), (150, 162, 184), 4)),
            (Crate, ((96, 62, 30), (176, 124, 68), 4)), (Raft, ((84, 56, 30), (160, 112, 60), 6)),
        ):  # fmt: skip
            for entity in self.level.of_class[mark.__name__]:
                thing = next(each for each in self.level.objects.values() if each.entity == entity)
                self.sprites.add(entity, self.plate(thing.size, *colours), metres=thing.size[1])

    def plate(self, size, dark, light, corner):
        surface = pygame.Surface((2 * TILE * size[0], 2 * TILE * size[1]), pygame.SRCALPHA)
        pygame.draw.rect(surface, dark, surface.get_rect(), border_radius=corner)
        pygame.draw.rect(surface, light, surface.get_rect().inflate(-10, -10), border_radius=corner)
        return surface

    def creature(self, colour, side):
        """With two eyes that look to one side."""
        surface = self.plate((0.8, 1.2), [0.5 * c for c in colour], colour, 20)
        for x in (34 + 10 * side, 22 + 10 * side):
            pygame.draw.circle(surface, "white", (x, 26), 8)
            pygame.draw.circle(surface, "black", (x + 3 * side, 27), 4)
        return surface

    def tile(self, number, step):
        """0 rock, 1 with moss, 2 a plank, 3 and 4 slopes, 5 and 6 belts in four steps, 7 to 9 what grows."""
        surface, random = pygame.Surface((TILE, TILE), pygame.SRCALPHA), np.random.default_rng(4 * number + step)
        edge = {3: [(0, TILE), (TILE, 0), (TILE, TILE)], 4: [(0, 0), (TILE, TILE), (0, TILE)]}
        if number in (0, 1, 3, 4):
            pygame.draw.polygon(surface, ROCK, edge.get(number, [(0, 0), (TILE, 0), (TILE, TILE), (0, TILE)]))
            for x, y in random.integers(4, TILE - 8, (3, 2)).tolist() if number < 2 else ():
                pygame.draw.ellipse(surface, [c + 9 * (x % 3 - 1) for c in ROCK], (x, y, 11, 7))
        if number == 1:
            pygame.draw.rect(surface, MOSS, (0, 0, TILE, 7))
            for x in range(3, TILE, 7):
                pygame.draw.circle(surface, MOSS, (x, 6), 4 + x % 3)
        elif number in edge:
            pygame.draw.line(surface, MOSS, *edge[number][:2], 9)
        elif number == 2:
            pygame.draw.rect(surface, (150, 108, 62), (0, 0, TILE, 9))
        elif number in (5, 6):
            pygame.draw.rect(surface, (52, 54, 62), (0, 0, TILE, TILE))
            for x in range(-TILE, TILE, TILE // 3):
                at = x + (step if number == 5 else 4 - step) * TILE // 12
                way = 4 if number == 5 else -4
                pygame.draw.lines(surface, (236, 190, 70), False, [(at, 3), (at + way, 9), (at, 15)], 3)
        elif number > 6:
            colour = ((226, 86, 96), (120, 220, 240), (120, 190, 100))[number - 7]
            for x in (9, 19, 27):
                high = int(random.integers(8, 20))
                pygame.draw.line(surface, (210, 204, 190), (x, TILE), (x, TILE - high), 3)
                pygame.draw.ellipse(surface, colour, (x - 6, TILE - high - 5, 13, 9))
        return surface

    def below(self, view):
        world, screen, camera = self.world, view.screen, view.camera
        ((hero, (me, place, _)),) = world.get_components(Character, Transform, Hero)
        camera.follow(place.interpolated_position + np.array((0, 1.5)), 1 / 60)
        screen.fill((26, 22, 34))
        for k in range(40):  # far rocks, which move less
            x = (k * 331 - 0.4 * TILE * camera.middle[0]) % (screen.get_width() + 400) - 200
            y = screen.get_height() * (k * 0.377 % 1.0) + 0.3 * TILE * (camera.middle[1] - 18)
            pygame.draw.circle(screen, (34 + k % 5, 29 + k % 4, 43), (x, y), 70 + 23 * (k % 6))
        low, high = camera.visible
        for name in ("growth", "rock"):
            tiles, step = self.level.layers[name].tiles, int(8 * world.time) % 4
            seen = ((tiles.place > low - 1) & (tiles.place < high)).all(axis=1)
            corners = np.floor(camera.to_screen(tiles.place[seen] + (0, 1))).astype(int).tolist()
            kinds, cells = self.kinds[tiles.picture[seen]], tiles.cell[seen]
            looks = kinds + 10 * np.where((kinds == 5) | (kinds == 6), step, cells.sum(axis=1) % 4)
            screen.fblits(list(zip([self.tiles[k] for k in looks.tolist()], corners, strict=True)))
        for mark, draw in ((Spikes, self.spikes), (Ladder, self.ladder), (Checkpoint, self.flag), (Goal, self.gate)):
            for entity in self.level.of_class[mark.__name__]:
                draw(entity, self.rect(entity))
        for entity, (_, collider) in world.get_components(Door, AABBCollider):
            if collider.enabled:
                pygame.draw.rect(screen, (120, 84, 50), self.rect(entity))
        for entity in self.level.of_class["Switch"]:
            pygame.draw.rect(screen, (220, 60, 60), self.rect(entity))
        if me.move:
            self.side = 1 if me.move > 0 else -1
        self.sprites.add(hero, self.heroes[self.side > 0], metres=1.2)
        for entity, (walker, _) in world.get_components(Walker, Transform):
            self.sprites.add(entity, self.walkers[walker.way > 0], metres=0.75)

    def rect(self, entity):
        """Pixels of its box."""
        place, shape = self.world.try_components(entity, Transform, AABBCollider)
        (x, y), size = self.view.camera.to_screen(place.position), 2 * TILE * shape.half_extents
        return pygame.Rect(x - size[0] / 2, y - size[1] / 2, *size)

    def spikes(self, entity, box):
        for x in range(box.left, box.right - 12, 14):
            pygame.draw.polygon(
                self.view.screen, (190, 192, 200), [(x, box.bottom), (x + 7, box.top), (x + 14, box.bottom)]
            )

    def ladder(self, entity, box):
        for y in range(box.top, box.bottom, 12):
            pygame.draw.line(self.view.screen, (140, 98, 54), (box.left, y), (box.right, y), 4)
        for x in (box.left, box.right - 4):
            pygame.draw.rect(self.view.screen, (164, 118, 66), (x, box.top, 4, box.height))

    def flag(self, entity, box):
        passed = box.centerx <= self.view.camera.to_screen((game_of(self.world).x + 0.1, 0))[0]
        pygame.draw.rect(self.view.screen, (190, 190, 196), (box.left, box.top, 4, box.height))
        points = [(box.left + 4, box.top), (box.left + 34, box.top + 11), (box.left + 4, box.top + 22)]
        pygame.draw.polygon(self.view.screen, (90, 210, 110) if passed else (210, 80, 80), points)

    def gate(self, entity, box):
        for k, colour in enumerate(((250, 220, 120), (255, 240, 190), (255, 252, 236))):
            pygame.draw.ellipse(self.view.screen, colour, box.inflate(-9 * k, -14 * k))

    def text(self, words, font, y, colour=(250, 246, 230)):
        for shift, tint in ((2, (20, 16, 24)), (0, colour)):
            drawn = self.fonts[font].render(words, True, tint)
            self.view.screen.blit(drawn, drawn.get_rect(center=(self.view.screen.get_width() / 2 + shift, y + shift)))

    def above(self, view):
        world, screen, to_screen, game = self.world, view.screen, view.camera.to_screen, game_of(self.world)
        for _, (_, place, box) in world.get_components(Mill, Transform, BoxCollider):
            c, s = np.cos(place.interpolated_rotation), np.sin(place.interpolated_rotation)
            corners = box.half_extents * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) @ ((c, s), (-s, c))
            points = to_screen(place.interpolated_position + corners).tolist()
            pygame.draw.polygon(screen, (150, 106, 60), points)
            pygame.draw.polygon(screen, (88, 60, 34), points, 4)
            pygame.draw.circle(screen, (88, 60, 34), to_screen(place.interpolated_position), 22)
        for entity in self.level.of_class["Water"]:
            box = self.rect(entity)
            if box.colliderect(screen.get_rect()):
                water = pygame.Surface(box.size, pygame.SRCALPHA)
                water.fill((50, 110, 200, 120))
                screen.blit(water, box)
                for x in range(box.left, box.right, 6):
                    y = box.top + 2 * sin(0.05 * (x - box.left) + 2 * world.time)
                    pygame.draw.rect(screen, (170, 210, 250), (x, y, 6, 3))
        if world.time < game.hurt + 0.25:
            screen.fill((255, 120, 120), special_flags=pygame.BLEND_MULT)
        for k in range(game.lives):
            for x in (22, 34):
                pygame.draw.circle(screen, (230, 70, 90), (x + 34 * k, 26), 8)
            pygame.draw.polygon(screen, (230, 70, 90), [(15 + 34 * k, 30), (41 + 34 * k, 30), (28 + 34 * k, 44)])
        if game.state == "title":
            self.text("CAVE RUN", 1, 200, (250, 214, 100))
            self.text("arrows or WASD walk and climb, space jumps, down drops through planks", 0, 290)
            self.text("any key" + "     L: from the last flag" * SAVED.is_file(), 0, 340, (150, 220, 250))
        elif game.state in ENDS:
            self.text(*ENDS[game.state])
            self.text(f"{game.coins} of 54 coins, {game.lives} lives, {game.seconds:.0f} s     return: again", 0, 290)
        else:
            self.text(f"{game.coins} coins     {game.seconds:.0f} s", 0, 28)


def tone(frequency, seconds=0.12, rate=22050):
    time = np.arange(int(seconds * rate)) / rate
    wave = np.sin(2 * pi * frequency * time) * np.exp(-18 * time)
    return pygame.mixer.Sound(buffer=(12000 * wave).astype(np.int16).tobytes())


def run(world, sound):
    """Plays until the window is closed, or another world is to be played: that is returned."""
    pictures = Pictures(world)
    world.on("saved", lambda: setattr(pictures, "save", True))
    if sound:
        pygame.mixer.init(22050, -16, 1)
        world.on("sound", lambda frequency: tone(frequency).play())
    gc.freeze()
    for passed in pictures.view:
        keys, tapped = pictures.view.keys, pygame.key.get_just_pressed()  # the second: also what is up again
        codes = [(OTHERS.get(name, name), pygame.key.key_code(name)) for name in (*KEYS, *OTHERS)]
        world.get_processor(Act).held = {name for name, code in codes if keys[code] or tapped[code]}
        world.advance(passed)
        if pictures.save:  # between two steps
            world.save(SAVED)
            pictures.save = False
        if keys[pygame.K_RETURN] and game_of(world).state in ENDS:
            return build(keys=None)
        if keys[pygame.K_l] and game_of(world).state == "title" and SAVED.is_file():
            return loaded(SAVED, pictures.level)
        if keys[pygame.K_ESCAPE]:
            return None
    return None


def main():
    world = build(keys=None)
    while world is not None:
        world = run(world, sound="--sound" in sys.argv)


if __name__ == "__main__":
    main()
