"""carom.scenes: one library of scenes for tests, benchmarks, the lab and demonstrations.

Every scene follows one protocol, ``build(settings, seed=0) -> World``; ``settings=None`` selects the scene's
own default. A file given to ``carom run FILE.py`` follows the same protocol.

>>> from carom import scenes
>>> world = scenes.get("billiards").build(seed=3)
"""

from . import (
    asteroids,
    billiards,
    bouncing,
    bullets,
    conveyor,
    cradle,
    drops,
    fastgas,
    freefall,
    galperin,
    gas2d,
    gas3d,
    jump,
    lift,
    maze,
    mixed2d,
    oblique,
    orbit,
    pile2d,
    pile3d,
    platforms,
    player,
    player_query,
    pyramid,
    shots,
    spring,
    stack,
    static_world,
    thermal_gas,
)
from .protocol import Build, Scene

_SCENES: dict[str, Scene] = {
    scene.name: scene
    for scene in (
        jump.SCENE,
        asteroids.SCENE,
        billiards.SCENE,
        gas2d.SCENE,
        gas3d.SCENE,
        mixed2d.SCENE,
        fastgas.SCENE,
        bullets.SCENE,
        shots.SCENE,
        player.SCENE,
        player_query.SCENE,
        maze.SCENE,
        static_world.SCENE,
        freefall.SCENE,
        pile2d.SCENE,
        pile3d.SCENE,
        pyramid.SCENE,
        stack.SCENE,
        platforms.SCENE,
        conveyor.SCENE,
        lift.SCENE,
        cradle.SCENE,
        galperin.SCENE,
        spring.SCENE,
        orbit.SCENE,
        bouncing.SCENE,
        oblique.SCENE,
        thermal_gas.SCENE,
        drops.SCENE,
    )
}


def names() -> tuple[str, ...]:
    """The names of all scenes, in the order of the library."""
    return tuple(_SCENES)


def get(name: str) -> Scene:
    """The scene called ``name``; KeyError, with the known names, for an unknown one."""
    try:
        return _SCENES[name]
    except KeyError:
        raise KeyError(f"no scene named {name!r}; there are: {', '.join(_SCENES)}") from None


__all__ = ["Build", "Scene", "get", "names"]
