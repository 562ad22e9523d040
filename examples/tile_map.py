"""A character runs and jumps over a tile map: python examples/tile_map.py

The map is drawn as text. In the world it is two entities, floors and walls, so that a character who leans against a
wall stands still on the floor. Balls roll about on the same map.
"""

from __future__ import annotations

from carom import AABBCollider, Physics, RigidBody, SphereCollider, TileGridCollider, Transform, World, cells_of_text
from carom.plugins import tile_grid

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
LAYER_CHARACTER, LAYER_REST = 2, 1


def places(mark):
    """The centres of the cells that hold the mark, in metres from the lower left corner of the map."""
    lines = MAP.split()
    return [(x + 0.5, len(lines) - y - 0.5) for y, line in enumerate(lines) for x, c in enumerate(line) if c == mark]


def main(seconds=12.0):
    world = World(Physics(dimensions=2, gravity=(0, -20)), tile_grid.plugin)
    cells = cells_of_text(MAP, empty=" .@o")
    for faces in TileGridCollider.floors_and_walls(cells, 1.0, lower=(0, 0)):
        world.create_entity(Transform((0, 0)), faces)
    for place in places("o"):
        world.create_entity(Transform(place), RigidBody(), SphereCollider(0.4, restitution=0.5))
    character = world.create_entity(
        Transform(places("@")[0]), RigidBody(), AABBCollider((0.35, 0.45), layer=LAYER_CHARACTER, mask=LAYER_REST)
    )
    transform, body = (world.component_for_entity(character, kind) for kind in (Transform, RigidBody))

    path = []
    while world.time < seconds:
        stands = any(contact.normal[1] < -0.7 for contact in world.contacts.of(character))  # normals point away from it
        blocked = any(contact.normal[0] > 0.7 for contact in world.contacts.of(character))
        body.linear_velocity = (SPEED, JUMP if stands and blocked else body.linear_velocity[1])
        world.step()
        path.append(tuple(transform.position))
        if world.step_count % 60 == 0:
            where = "leans on a wall" if blocked else "runs" if stands else "is in the air"
            print(f"{world.time:5.2f} s  x = {transform.x:6.3f}  y = {transform.y:6.3f}  {where}")
    return path


if __name__ == "__main__":
    main()
