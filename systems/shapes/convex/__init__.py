"""The pair of any two convex shapes, known by their farthest points in a direction (supports) and their roundings.

gjk walks to the point of their Minkowski difference nearest to the origin: the distance of shapes that are apart.
epa2d and epa3d find how deep the origin lies inside it: the overlap. pair puts both together, for functions of plugins
that have the supports at hand, and for supports that linking/convex_by_address calls through the tables of a scene:
then it is compiled once per dimension, and a new convex shape costs its ``support`` and ``rounding`` alone.

points gives the several points in which two of them touch, for what spins: from the same supports, by address.
"""
