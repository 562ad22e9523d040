"""Maps of level editors, loaded into a world: Tiled's .tmx and .tmj, and LDtk's .ldtk.

``level = maps.load("level.tmx", world, components=(Coin, Enemy))``. A file is read into plain data (``formats``), its
classes and properties are looked up (``fields``), and entities are planned (``bodies``, ``tiles``); they are made when
nothing was found to be wrong (``plan``). ``pictures`` draws a level with pygame.
"""

from .errors import Finding, MapError
from .level import Level
from .loading import check, levels_of, load, world_of

__all__ = ["Finding", "Level", "MapError", "check", "levels_of", "load", "world_of"]
