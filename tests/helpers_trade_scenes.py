"""User scene files for the tests of `carom trade`: each minimal, in 2D, and of a different kind."""

from __future__ import annotations

from pathlib import Path

HEAD = '''"""{first_line}"""
from pathlib import Path
import numpy as np
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, World
from carom.plugins import Physics
'''

BALL = '''
seconds = 1.7
def build(settings, seed=0, speed=3.0):
    world = World(Physics(dimensions=2, gravity=(0.0, -10.0)), settings=settings)
    world.create_entity(Transform((0.0, -1.0)), AABBCollider((50.0, 1.0), restitution=1.0))
    world.create_entity(
        Transform((0.0, 1.25)), RigidBody(linear_velocity=(speed, 0.0)), SphereCollider(0.25, restitution=1.0))
    return world
'''

SPRING = '''
seconds = 1.3
class Pull(ForceSystem):
    def add_forces(self, bodies, time):
        bodies.force[:] -= {stiffness} * bodies.position
    def potential_energy(self, bodies):
        return 0.5 * {stiffness} * float((bodies.position ** 2).sum())
def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0.0, 0.0)), settings=settings)
    world.add_system(Pull())
    world.create_entity(Transform((1.0, 0.0)), RigidBody(mass=1.0))
    return world
'''

CROWD = '''
seconds = 3.0
def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0.0, 0.0)), settings=settings)
    for x, y, w, h in ((-6, 0, 1, 7), (6, 0, 1, 7), (0, -6, 7, 1), (0, 6, 7, 1)):
        world.create_entity(Transform((x, y)), AABBCollider((w, h), restitution=1.0))
    angles = np.random.default_rng(seed).uniform(0, 2 * np.pi, (4, 4))
    for (i, j), angle in np.ndenumerate(angles):
        body = RigidBody(linear_velocity=(8.0 * np.cos(angle), 8.0 * np.sin(angle)))
        world.create_entity(Transform((2 * i - 3, 2 * j - 3)), body, SphereCollider(0.5, restitution=1.0))
    return world
'''

REST = '''
seconds = 1.0
def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0.0, -10.0)), settings=settings)
    world.create_entity(Transform((0.0, -1.0)), AABBCollider((10.0, 1.0)))
    world.create_entity(Transform((0.0, 0.5)), RigidBody(), AABBCollider((0.5, 0.5)))
    return world
'''

BULLET = '''
seconds = 0.2
def build(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0.0, 0.0)), settings=settings)
    world.create_entity(Transform((2.0, 0.0)), AABBCollider((0.05, 5.0), restitution=1.0))
    world.create_entity(
        Transform((0.0, 0.0)), RigidBody(linear_velocity=(50.0, 0.0)), SphereCollider(0.1, restitution=1.0))
    return world
'''

def scene_file(folder: Path, text: str, name: str = "mine.py", first_line: str = "A scene of one's own.") -> str:
    """Write the file; returns its path as typed on the command line."""
    path = folder / name
    path.write_text(HEAD.format(first_line=first_line) + text, encoding="utf-8")
    return str(path)
