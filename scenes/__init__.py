"""carom.scenes: one library of scenes for tests, benchmarks, the lab and demonstrations.

Every scene follows one protocol, ``build(settings, seed=0) -> World``; ``settings=None`` selects the scene's
own default. A file given to ``carom run FILE.py`` follows the same protocol.

The scenes are in folders by subject: motion, impacts, gases, rest, levels, turning and joined. All can be imported from
here.

>>> from carom import scenes
>>> world = scenes.get("billiards").build(seed=3)
"""

from .gases import asteroids, fastgas, gas2d, gas3d, mixed2d, player_query, thermal_gas
from .impacts import billiards, bouncing, bullets, cradle, drops, galperin, oblique, shots
from .joined import bridge, car, crane, ragdoll
from .levels import conveyor, lift, maze, platforms, player, static_world
from .motion import freefall, jump, orbit, spring
from .protocol import Build, Scene
from .rest import few, pile, pile2d, pile3d, pyramid, stack
from .turning import billiards_spin, dominoes, flipper, hills, pieces, rubble, tumbler

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
        few.SCENE,
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
        billiards_spin.SCENE,
        flipper.SCENE,
        dominoes.SCENE,
        tumbler.SCENE,
        rubble.SCENE,
        pieces.SCENE,
        bridge.SCENE,
        ragdoll.SCENE,
        car.SCENE,
        crane.SCENE,
        hills.SCENE,
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


__all__ = [
    "Build",
    "Scene",
    "asteroids",
    "billiards",
    "billiards_spin",
    "bouncing",
    "bridge",
    "bullets",
    "car",
    "conveyor",
    "cradle",
    "crane",
    "dominoes",
    "drops",
    "fastgas",
    "flipper",
    "freefall",
    "galperin",
    "gas2d",
    "gas3d",
    "get",
    "hills",
    "jump",
    "lift",
    "maze",
    "mixed2d",
    "names",
    "oblique",
    "orbit",
    "pile",
    "pile2d",
    "pile3d",
    "platforms",
    "player",
    "player_query",
    "pyramid",
    "ragdoll",
    "rubble",
    "shots",
    "spring",
    "stack",
    "static_world",
    "thermal_gas",
    "tumbler",
]
