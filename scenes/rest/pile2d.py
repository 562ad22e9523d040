"""1,000 discs fall into a bin and come to rest.

``n`` discs of :mod:`carom.scenes.rest.pile`; ``seed`` chooses their places.
"""

from carom.scenes.rest import pile

SECONDS = 15.0
VIEW = pile.view(2)
build = pile.pile2d
