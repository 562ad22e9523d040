"""1,000 spheres fall into a bin and come to rest.

``n`` spheres of :mod:`carom.scenes.rest.pile`; ``seed`` chooses their places.
"""

from carom.scenes.rest import pile

SECONDS = 10.0
VIEW = pile.view(3)
build = pile.pile3d
