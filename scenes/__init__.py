"""carom.scenes: one library of scenes for tests, benchmarks, the lab and demonstrations.

Each is a module as ``carom run FILE.py`` takes it: ``build(settings, seed=0) -> World``, where ``settings=None``
selects the scene's own default, ``SECONDS``, ``VIEW`` and perhaps ``SETTINGS``. A copy of the file is a scene of one's
own.

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

_MODULES = (
    jump, asteroids, billiards, gas2d, gas3d, mixed2d, fastgas, bullets, shots, player, player_query, maze,
    static_world, freefall, pile2d, pile3d, pyramid, stack, few, platforms, conveyor, lift, cradle, galperin, spring,
    orbit, bouncing, oblique, thermal_gas, drops, billiards_spin, flipper, dominoes, tumbler, rubble, pieces, bridge,
    ragdoll, car, crane, hills,
)  # fmt: skip
_SCENES = {scene.name: scene for scene in map(Scene.of, _MODULES)}


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
    "Build", "Scene", "asteroids", "billiards", "billiards_spin", "bouncing", "bridge", "bullets", "car", "conveyor",
    "cradle", "crane", "dominoes", "drops", "fastgas", "few", "flipper", "freefall", "galperin", "gas2d", "gas3d",
    "get", "hills", "jump", "lift", "maze", "mixed2d", "names", "oblique", "orbit", "pieces", "pile", "pile2d",
    "pile3d", "platforms", "player", "player_query", "pyramid", "ragdoll", "rubble", "shots", "spring", "stack",
    "static_world", "thermal_gas", "tumbler",
]  # fmt: skip
