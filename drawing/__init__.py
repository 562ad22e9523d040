"""What a world looks like, as plain arrays; no drawing library is imported.

``Drawing(world).update()`` makes a :class:`DrawingList`: polygons, circles, lines and points with a style each, of all
bodies where they are drawn. :mod:`lists` is what comes out; :mod:`outlines` and :mod:`convex` what one shape looks
like, :mod:`outline_cache` the shapes that are known, :mod:`shapes` where they are in a frame, :mod:`overlays` what is
drawn over them.
"""

from .drawing import Drawing
from .lists import Capsules, Circles, DrawingList, Lines, Points, Polygons, Style

__all__ = ["Capsules", "Circles", "Drawing", "DrawingList", "Lines", "Points", "Polygons", "Style"]
