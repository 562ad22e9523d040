"""A character runs and jumps over a tile map: python examples/tile_map.py

The map is drawn as text, and is one entity. The character jumps where a wall is in its way. Balls lie on the same map;
it pushes them aside.
"""

from __future__ import annotations

from carom import AABBCollider, Physics, RigidBody, SphereCollider, TileGridCollider, Transform, World, cells_of_text
from carom.plugins import tile_grid
from carom.plugins.character import Character, Characters

MAP = """
    ############################################################
    #..........................................................#
    #..........................................................#
    #.................................................o........#
    #..@.............................o..............#####......#
    #.........................#########....##..................#
    #..............###.....####.......##..####.................#
    #####..####################.......########....##############
    ############################################################
"""
SPEED, JUMP = 6.0, 9.0


def places(mark):
    """The centres of the cells that hold the mark, in metres from the lower left corner of the map."""
    lines = MAP.split()
    return [(x + 0.5, len(lines) - y - 0.5) for y, line in enumerate(lines) for x, c in enumerate(line) if c == mark]


def main(seconds=12.0):
    world = World(Physics(dimensions=2, gravity=(0, -20)), tile_grid.plugin, Characters())
    cells = cells_of_text(MAP, empty=" .@o")
    world.create_entity(Transform((0, 0)), TileGridCollider(cells, 1.0, lower=(0, 0)))
    for place in places("o"):
        world.create_entity(Transform(place), RigidBody(), SphereCollider(0.4, restitution=0.5))
    entity = world.create_entity(
        Transform(places("@")[0]), RigidBody(kind="kinematic"), AABBCollider((0.35, 0.45)),
        Character(move=SPEED, jump_speed=JUMP, step_height=0.1),
    )  # fmt: skip
    transform, character = (world.component_for_entity(entity, kind) for kind in (Transform, Character))

    path = []
    while world.time < seconds:
        character.jump = character.on_wall and character.state == "floor"
        world.step()
        path.append(tuple(transform.position))
        if world.step_count % 60 == 0:
            where = "leans on a wall" if character.on_wall else "is in the air" if character.state == "air" else "runs"
            print(f"{world.time:5.2f} s  x = {transform.x:6.3f}  y = {transform.y:6.3f}  {where}")
    return path


if __name__ == "__main__":
    main()
