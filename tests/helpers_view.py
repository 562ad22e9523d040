"""A hand at a window that is not on a screen: keys and mouse by posted events, frame by frame."""

import pygame

from carom import AABBCollider, Physics, RigidBody, SphereCollider, Transform, World
from carom.view import View


class Player:
    """Shows a world in frames of 1/60 s, each as long as it takes."""

    def __init__(self, world, size=(640, 480), **options):
        self.view = View(world, size, real_time=False, **options)
        self._frames = iter(self.view)

    def frame(self, count=1):
        """So many frames; the seconds that the last one gave."""
        seconds = 0.0
        for _ in range(count):
            seconds = next(self._frames)
            self.view.world.advance(seconds)
        return seconds

    def key(self, key, text="", mod=0):
        """Press a key of pygame, or that of a letter, and show a frame."""
        code = ord(key) if isinstance(key, str) else key
        text = key if isinstance(key, str) else text
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=code, unicode=text, mod=mod))
        return self.frame()

    def type(self, text):
        for letter in text:
            self.key(letter)

    def mouse(self, kind, at, button=1, **values):
        """A mouse event at these pixels, and a frame."""
        at = tuple(int(number) for number in at)
        if kind != pygame.MOUSEMOTION:
            values["button"] = button
        pygame.event.post(pygame.event.Event(kind, pos=at, **values))
        return self.frame()

    def pixel_of(self, place):
        return self.view.camera.to_screen(place)

    def press(self, place):
        return self.mouse(pygame.MOUSEBUTTONDOWN, self.pixel_of(place))

    def move(self, place):
        return self.mouse(pygame.MOUSEMOTION, self.pixel_of(place), buttons=(1, 0, 0), rel=(0, 0))

    def release(self, place):
        return self.mouse(pygame.MOUSEBUTTONUP, self.pixel_of(place))


def floor_and_ball(*plugins, settings=None):
    """A ball on a floor, another that flies by; their ids."""
    world = World(Physics(2, gravity=(0.0, -10.0)), *plugins, settings=settings)
    world.create_entity(Transform((0.0, -0.5)), AABBCollider((8.0, 0.5), friction=0.5))
    ball = world.create_entity(Transform((3.0, 0.5)), RigidBody(), SphereCollider(0.5, friction=0.5))
    world.create_entity(Transform((-3.0, 4.0)), RigidBody(linear_velocity=(0.5, 0.0)), SphereCollider(0.3))
    return world, ball
