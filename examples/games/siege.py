"""Siege: two catapults, two castles, two kings: python examples/games/siege.py [two | host | join HOST]

Alone it has both players at one keyboard: W S aim, hold D and let go to throw, A loads a bomb, or the arrows. ``two``
opens two windows here that play over UDP, ``host`` and ``join HOST`` one each. Only keys are sent: each side plays on
at once with what it knows, goes back up to 8 frames when the other's keys arrive, and compares the hash of its world.
"""

from __future__ import annotations

import socket
import struct
import subprocess
import sys
from functools import cache
from math import cos, hypot, pi, sin
from pathlib import Path

import numpy as np

from carom import Component, Phase, Physics, RigidBody, SphereCollider, System, Transform, World, column
from carom.framework import Rollback, Settings
from carom.lab import Inputs
from carom.plugins.joints import Distance, Hinge, Joints, Weld
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.timers import Timer, Timers
from carom.plugins.zones import Zones, explode
from carom.view import Sprites, View

KEYS = ("w", "s", "d", "a", "up", "down", "left", "right")  # aim up and down, throw, bomb: left player, right player
KING, PIVOT, ARM_LENGTH, SLING = 1000.0, 3.0, 4.0, 1.8  # N s that he bears, m
REST = 1.22 * pi  # rad, from where an arm points to the enemy, over its top
COLOURS = (150, 146, 138), (146, 100, 56), (128, 122, 114), (240, 190, 60), (104, 100, 98), (36, 36, 44)
PLAYERS = ("BLUE", (70, 130, 230)), ("RED", (230, 80, 80))
PORT, RECORDED = 51790, Path(__file__).with_name("siege.keys")
seconds = 12.0


class Game(Component):
    """What is no body."""

    state: str = column(default="title", choices=("title", "play", "over"))
    winner: int = column(default=-1, dtype=int)
    held: int = column(default=0, dtype=int)  # the keys of the last step, as bits


class Catapult(Component):
    """On an arm."""

    side: int = column(default=0, dtype=int)
    hinge: int = column(default=-1, dtype=int)
    sling: int = column(default=-1, dtype=int)  # a rope, while there is something in it
    shot: int = column(default=-1, dtype=int)
    aim: float = column(default=0.8)  # rad
    power: float = column(default=0.0)  # 0 to 1
    thrown: float = column(default=0.0)  # power of the last throw
    state: str = column(default="empty", choices=("empty", "ready", "throws"))
    bombs: int = column(default=3, dtype=int)
    bomb: bool = column(default=False, dtype=bool)  # in the sling


class Solid(Component):
    """Breaks."""

    health: float = column(default=900.0)  # N s beyond what it bears
    bears: float = column(default=150.0)  # N s in a step
    king: int = column(default=-1, dtype=int)  # whose king it is


class Fades(Component):
    """Is there until that time of the world."""

    until: float = column(default=0.0)
    bomb: bool = column(default=False, dtype=bool)  # bursts when it touches something


class Act(System):
    """Before each step: keys to aims, arms and slings."""

    phase = Phase.START

    def __init__(self, keys=None):
        super().__init__()
        self.keys, self.held = keys, frozenset()  # the window, or play, writes what is held

    def process(self, dt):
        world, game = self.world, game_of(self.world)
        held = self.held if self.keys is None else self.keys.held(world.time, dt)
        bits = sum(1 << k for k, name in enumerate(KEYS) if name in held)
        before, game.held = game.held, bits
        if game.state == "title" and bits:
            game.state = "play"
        for arm, (catapult, transform) in world.get_components(Catapult, Transform):
            shift = 8 if game.state == "over" else 4 * catapult.side  # when it is over nobody is heard
            self.work(arm, catapult, transform, bits >> shift & 15, before >> shift & 15, dt)

    def work(self, arm, catapult, transform, held, before, dt):
        world, ahead = self.world, 1 - 2 * catapult.side
        hinge = world.component_for_entity(catapult.hinge, Hinge)
        turned = transform.rotation if ahead > 0 else pi - transform.rotation
        catapult.aim = min(max(catapult.aim + 0.6 * dt * ((held & 1) - (held >> 1 & 1)), 0.1), 1.4)
        if catapult.state == "empty" and turned > REST - 0.02 and not world.has_component(arm, Timer):
            self.load(world, arm, catapult, transform, ahead, bomb=False)
        elif catapult.state == "ready":
            if held & ~before & 8 and catapult.bombs:
                catapult.bombs -= 1
                world.delete_entity(catapult.shot)
                self.load(world, arm, catapult, transform, ahead, bomb=True)
            if held & 4:
                catapult.power = min(catapult.power + dt / 1.5, 1.0)
            elif before & 4:
                catapult.state, catapult.thrown, catapult.power = "throws", catapult.power, 0.0
                hinge.motor_speed = -ahead * (1.2 + 1.9 * catapult.thrown)
        elif catapult.state == "throws":
            vx, vy = world.component_for_entity(catapult.shot, RigidBody).linear_velocity
            if turned < -0.3 or (ahead * vx > 0 and vy < hypot(vx, vy) * sin(catapult.aim)):
                away = np.array((ahead * cos(catapult.aim), sin(catapult.aim)))  # the sling opens within the step
                world.component_for_entity(catapult.shot, RigidBody).linear_velocity = hypot(vx, vy) * away
                world.delete_entity(catapult.sling)
                world.add_component(catapult.shot, Fades(world.time + 9.0, catapult.bomb))
                world.add_component(arm, Timer(2.0))
                catapult.state, hinge.motor_speed = "empty", ahead * 1.5

    def load(self, world, arm, catapult, transform, ahead, bomb):
        tip = transform.position + ARM_LENGTH / 2 * np.array((cos(transform.rotation), sin(transform.rotation)))
        radius, mass = (0.3, 25.0) if bomb else (0.36, 60.0)
        place, shape = (tip[0] + ahead * (SLING - 0.1), radius), SphereCollider(radius, friction=0.6)
        catapult.shot = world.create_entity(Transform(place), RigidBody(mass, ccd=True), Spin(), shape)
        catapult.sling = world.create_entity(Distance(arm, catapult.shot, point_a=tip, length=(0.0, SLING)))
        catapult.state, catapult.bomb = "ready", bomb


class Harm(System):
    """After each step: what breaks, bursts and fades."""

    def process(self, dt):
        world, bodies, contacts = self.world, self.world.bodies, self.world.contacts
        strong = contacts.normal_impulse > 50.0
        impulse = contacts.normal_impulse[strong]
        for ids in (contacts.entity_a, contacts.entity_b):  # what is not Solid has columns too, and does not break
            rows = bodies.rows_of(ids[strong])
            np.subtract.at(bodies.solid.health, rows, np.maximum(impulse - bodies.solid.bears[rows], 0.0))
        for bomb, _, contact in contacts.begin.pairs(Fades, Transform):
            if world.component_for_entity(bomb, Fades).bomb:
                world.delete_entity(bomb)
                pushed = explode(world, contact.point, radius=4.0, impulse=500.0)
                bodies.solid.health[bodies.rows_of(pushed)] -= 500.0
        for entity in bodies.entity[bodies.has(Solid) & (bodies.solid.health <= 0.0)].tolist():
            self.shatter(entity)
        fading = bodies.has(Fades)
        world.delete_entities(bodies.entity[fading][bodies.fades.until[fading] <= world.time])

    def shatter(self, entity):
        world, game = self.world, game_of(self.world)
        transform, body, solid = world.try_components(entity, Transform, RigidBody, Solid)
        world.delete_entity(entity)
        if solid.king >= 0:
            game.state, game.winner = "over", 1 - solid.king if game.winner < 0 else game.winner
            return
        half = world.component_for_entity(entity, BoxCollider).half_extents / 2
        c, s = cos(transform.rotation), sin(transform.rotation)
        corners = half * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)]) @ np.array(((c, s), (-s, c)))
        world.create_entities(
            4, Transform.many(transform.position + corners, rotation=transform.rotation), Spin.many(),
            RigidBody.many(mass=body.mass / 4, ccd=True, linear_velocity=body.linear_velocity + corners * 4.0),
            BoxCollider.many(half_extents=0.94 * half, friction=0.6),
            Fades.many(until=world.time + 6.0),
        )  # fmt: skip


def box(world, x, y, half, mass=60.0, health=900.0):
    shape = BoxCollider(half, friction=0.7)
    return world.create_entity(Transform((x, y)), RigidBody(mass), Spin(), shape, Solid(health))


def castle(world, side, x, rows):
    """Two towers of stones, and a hall of welded beams on them with the king in it."""
    for tower in (-3.5, 3.5):
        for row in range(rows):
            odd = ((-1.25, 0.25), (-0.5, 0.5), (0.5, 0.5), (1.25, 0.25))
            for place, half in odd if row % 2 else ((-1.0, 0.5), (0.0, 0.5), (1.0, 0.5)):
                box(world, x + tower + place, 0.25 + 0.5 * row, (half, 0.25), 120.0 * half)
        for place in (-1.25, 1.25):
            box(world, x + tower + place, 0.5 * rows + 0.85, (0.25, 0.4), 40.0)
    y = 0.5 * rows + 0.15
    floor = [box(world, x - 4.0 + 1.6 * k, y, (0.8, 0.15), 30.0, 600.0) for k in range(6)]
    roof = box(world, x, y + 2.3, (2.0, 0.15), 25.0, 500.0)
    joints = [(floor[k], floor[k + 1], (x - 3.2 + 1.6 * k, y)) for k in range(5)]
    for k, place in ((1, x - 1.6), (4, x + 1.6)):
        post = box(world, place, y + 1.15, (0.15, 1.0), 25.0, 500.0)
        joints += [(floor[k], post, (place, y + 0.15)), (post, roof, (place, y + 2.15))]
    for a, b, anchor in joints:
        world.create_entity(Weld(a, b, anchor=anchor, breaking_force=12000.0, breaking_torque=6000.0))
    shape, spin = SphereCollider(0.4, friction=0.8), Spin(rolling_friction=0.1)
    world.create_entity(Transform((x, y + 0.55)), RigidBody(40.0), spin, shape, Solid(KING, 60.0, side))


def catapult(world, side, x, ahead):
    rotation = REST if ahead > 0 else pi - REST
    middle = np.array((x, PIVOT)) + (ARM_LENGTH / 2 - 0.8) * np.array((cos(rotation), sin(rotation)))
    beam = BoxCollider((ARM_LENGTH / 2, 0.12), mask=0)
    arm = world.create_entity(Transform(middle, rotation), RigidBody(80.0), Spin(), beam)
    hinge = Hinge(None, arm, anchor=(x, PIVOT), limits=sorted((0.0, -ahead * (REST + 0.6))), max_torque=60000.0)
    hinge.motor_speed = 1.5 * ahead
    world.add_component(arm, Catapult(side, hinge=world.create_entity(hinge)))


def build(settings=None, seed=0, keys=RECORDED, rows=9):
    """A world; ``keys``: a file of recorded keys that plays it, or None: what is held is told to its system Act."""
    settings = settings or Settings(substeps=8, sleeping=True)
    world = World(Physics(dimensions=2, gravity=(0, -10)), Rotation(), Joints(), Timers(), Zones(), settings=settings)
    world.register(Solid, Fades, Catapult)
    world.create_entity(Game())
    world.create_entity(Transform((0, -2)), BoxCollider((80, 2), friction=0.8))
    for side, ahead in enumerate((1, -1)):
        castle(world, side, -21.0 * ahead, rows)
        catapult(world, side, -10.0 * ahead, ahead)
    world.add_system(Act(keys and Inputs.read(keys)))
    world.add_system(Harm())
    return world


def compared(world):
    """What carom trade compares."""
    return {"winner": game_of(world).winner, "stones": len(world.get_component(Solid))}


def game_of(world):
    return world.get_component(Game)[0][1]


def play(frames, world=None, **how):
    """Steps a world, by default a new one, once with each set of keys; returns it."""
    world = world or build(keys=None, **how)
    for world.get_processor(Act).held in frames:
        world.step()
    return world


class Peer:
    """Player 0 or 1 of two who play over a network, each with a world of its own."""

    def __init__(self, number, host=None, port=PORT, **how):
        self.number, self.world, self.differs, self.compared = number, build(keys=None, **how), False, 0
        self.rollback = Rollback(self.world, self.hold, most=8)
        self.link, self.other = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), host and (host, port)
        self.link.bind(("", 0 if host else port))
        self.link.setblocking(False)

    def hold(self, players):
        self.world.get_processor(Act).held = {name for k, name in enumerate(KEYS) if players[k // 4] >> k % 4 & 1}

    def hear(self):
        """The other's keys, of all frames that may be missing here, and the hash of one."""
        try:
            while True:
                packet, sender = self.link.recvfrom(2048)
                self.other = self.other or sender  # who hosts answers who comes first
                start, frame, there = struct.unpack_from("<II64s", packet)
                self.rollback.give(1 - self.number, start, packet[72:])
                found = self.rollback.differs(frame, there.decode(errors="replace"))
                self.differs, self.compared = self.differs or bool(found), self.compared + (found is not None)
        except (OSError, struct.error):  # nothing more has come
            return

    def play(self, bits):
        """A frame with one's own keys, unless the other is too far behind."""
        mine = self.rollback.inputs(self.number)
        if len(mine) == self.rollback.frame:
            self.rollback.give(self.number, len(mine), [bits])
        self.rollback.step()

    def tell(self):
        mine, (frame, here) = self.rollback.inputs(self.number), self.rollback.checksum()
        start = max(0, len(mine) - 20)
        if self.other:
            self.link.sendto(struct.pack("<II64s", start, frame, here.encode()) + bytes(mine[start:]), self.other)


@cache
def picture(kind, width, height, cracked):
    """Stones, wood, rubble, the king, a stone that is thrown, a bomb."""
    surface = pygame.Surface((64 * width, 64 * height), pygame.SRCALPHA)
    box, colour, corner = surface.get_rect(), COLOURS[kind], 3 if kind < 3 else 40
    pygame.draw.rect(surface, [0.6 * c for c in colour], box, border_radius=corner)
    pygame.draw.rect(surface, colour, box.inflate(-6, -6), border_radius=corner)
    for k in range(3 * cracked):
        x, y = box.width * (k + 1) / (3 * cracked + 1), box.height * (k % 2)
        pygame.draw.line(surface, (50, 46, 44), (x, y), (x + 9 - 6 * (k % 4), box.height / 2), 3)
    if kind == 3:
        pygame.draw.polygon(surface, "red3", [(8, 18), (5, 2), (17, 10), (25, 0), (34, 10), (46, 2), (43, 18)])
    for x in (16, 34) if kind == 3 else (30,) if kind > 3 else ():  # eyes, or what shows how it turns
        pygame.draw.circle(surface, "orange" if kind == 5 else "black", (x, 27 if kind == 3 else 13), 4)
    return surface


class Pictures:
    """A window on a world, with a sprite for each body."""

    def __init__(self, world, **how):
        global pygame  # only pictures need it
        import pygame

        self.world, self.sprites, self.looks, self.line = world, Sprites(world), {}, ""
        how |= {"controls": False, "outlines": False, "rewind_megabytes": 0, "title": "Siege"}
        self.view = View(world, sprites=self.sprites, below=self.below, above=self.above, **how)
        self.view.show["joints"] = False
        self.fonts = [pygame.font.Font(None, size) for size in (30, 120)]

    def dress(self):
        """Each body gets a sprite by what it is and how broken; after a rollback an id may be another body."""
        bodies = self.world.bodies
        breaks, arm, ball = bodies.has(Solid), bodies.has(Catapult), bodies.has(SphereCollider)
        radius, half = bodies.sphere_collider.radius[:, None], bodies.box_collider.half_extents
        wood, bomb = arm | (bodies.mass < 26.0), radius[:, 0] < 0.33
        kinds = np.select([breaks & ball, ball, breaks | arm], [3, 4 + bomb, wood], 2)
        sizes = 2 * np.where(ball[:, None], radius, half)
        cracked = (np.clip(3 - bodies.solid.health // 300, 0, 2) * (breaks & ~ball)).astype(int)
        for entity, *look in zip(*(a.tolist() for a in (bodies.entity, kinds, *sizes.T, cracked)), strict=True):
            if self.looks.get(entity) != look and look[2] < 3.0:  # the ground has none
                self.looks[entity] = look
                self.sprites.add(entity, picture(*look), metres=look[2])

    def below(self, view):
        screen, camera, (width, height) = view.screen, view.camera, view.camera.size
        camera.fit((-26, -2.5), (26, 24))
        self.dress()
        for y in range(0, height, 8):
            pygame.draw.rect(screen, (90 + 110 * y // height, 150 + 60 * y // height, 215), (0, y, width, 8))
        for k, (colour, high) in enumerate((((120, 160, 150), 6.0), ((92, 138, 108), 3.5))):
            hills = [(x, high + 1.3 * sin(0.31 * x + 2 * k) + 0.8 * sin(0.8 * x)) for x in range(-60, 61)]
            pygame.draw.polygon(screen, colour, camera.to_screen([(-60, -9), *hills, (60, -9)]).tolist())
        pygame.draw.rect(screen, (92, 74, 50), (0, camera.to_screen((0, 0))[1], width, height))
        pygame.draw.rect(screen, (96, 150, 66), (0, camera.to_screen((0, 0))[1], width, 9))
        for pivot, foot in ((pivot, foot) for pivot in (-10, 10) for foot in (-1.2, 1.2)):
            pygame.draw.line(screen, (92, 60, 34), *camera.to_screen([(pivot + foot, 0), (pivot, 3.2)]).tolist(), 9)

    def text(self, words, font, y, colour=(250, 246, 230)):
        for shift, tint in ((2, (40, 36, 40)), (0, colour)):
            drawn = self.fonts[font].render(words, True, tint)
            self.view.screen.blit(drawn, drawn.get_rect(center=(self.view.camera.size[0] / 2 + shift, y + shift)))

    def bar(self, part, x, y, width, colour):
        pygame.draw.rect(self.view.screen, (30, 28, 34), (x, y, width, 16))
        pygame.draw.rect(self.view.screen, colour, (x + 2, y + 2, (width - 4) * min(max(part, 0), 1), 12))

    def above(self, view):
        world, screen, to_screen, width = self.world, view.screen, view.camera.to_screen, view.camera.size[0]
        for _, (catapult, place) in world.get_components(Catapult, Transform):
            ahead, turn = 1 - 2 * catapult.side, place.interpolated_rotation
            if catapult.state != "empty":
                tip = place.interpolated_position + ARM_LENGTH / 2 * np.array((cos(turn), sin(turn)))
                ends = tip, world.component_for_entity(catapult.shot, Transform).interpolated_position
                pygame.draw.line(screen, (60, 44, 30), *to_screen(ends).tolist(), 3)
            for k in range(3, 8):
                way = 0.7 * k * cos(catapult.aim) * ahead, 0.7 * k * sin(catapult.aim)
                pygame.draw.circle(screen, "white", to_screen((way[0] - 10 * ahead, way[1] + PIVOT)), 3)
            x, y = to_screen((-10 * ahead, -1.0))
            self.bar(catapult.power, x - 60, y, 120, (240, 150, 50))
            pygame.draw.rect(screen, "white", (x - 60 + 118 * catapult.thrown, y, 2, 16))
            for k in range(catapult.bombs):
                pygame.draw.circle(screen, (36, 36, 44), (x - 20 + 20 * k, y + 28), 7)
        for king in np.flatnonzero(world.bodies.has(Solid) & (world.bodies.solid.king >= 0)):
            side, part = world.bodies.solid.king[king], world.bodies.solid.health[king] / KING
            self.bar(part, (width - 340) * side + 20, 20, 300, PLAYERS[side][1])
        game = game_of(world)
        if game.state == "title":
            self.text("SIEGE", 1, 130, (250, 214, 100))
            self.text("left: W S aim, hold D and let go, A bomb        right: arrows", 0, 220)
        if game.state == "over":
            self.text(PLAYERS[game.winner][0] + " WINS", 1, 150, PLAYERS[game.winner][1])
        self.text(self.line, 0, 30)


def main(how="alone", host="localhost"):
    if how == "two":
        subprocess.Popen([sys.executable, *sys.argv[: not getattr(sys, "frozen", False)], "join"])
    peer = None if how == "alone" else Peer(1, host) if how == "join" else Peer(0)
    world = peer.world if peer else build(keys=None)
    pictures, start, late = Pictures(world), world.snapshot(), 0.0
    for passed in pictures.view:
        down, tapped = pictures.view.keys, pygame.key.get_just_pressed()  # the second: also what is up again
        held = {name for name in KEYS if down[pygame.key.key_code(name)] or tapped[pygame.key.key_code(name)]}
        if peer:
            peer.hear()
            late = min(late + passed, 0.1)
            while late >= world.settings.dt and peer.other:
                late -= world.settings.dt
                peer.play(sum(1 << k for k in range(4) if {KEYS[k], KEYS[k + 4]} & held))  # either set of keys
            peer.tell()
            pictures.line = "the worlds differ" if peer.differs else "" if peer.compared else "waiting for the other"
        else:
            pictures.line = "return: again" if game_of(world).state == "over" else ""
            if pictures.line and down[pygame.K_RETURN]:
                world.restore(start)
            world.get_processor(Act).held = held
            world.advance(passed)


if __name__ == "__main__":
    main(*sys.argv[1:])
