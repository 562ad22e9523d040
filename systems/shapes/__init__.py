"""Shapes and pairs of shapes: the functions of plugins, generated into one dispatch for each world.

Reads the registry of the world. Writes the kernels' dispatch from a pair of shapes to its function, the levels of
geometry, the mixing of materials, and the tolerances, which are in proportion to the bodies' extents.
"""
