"""Queries of a world between steps: overlap, ray and shape casts, nearest bodies, neighbours within a distance.

Reads positions, shapes, layers and the indexes of the broad phase. Writes nothing but the arrays of results.
"""
