"""Contacts of convex shapes that have only a support function: GJK for the distance, EPA (2D, 3D) for the overlap.

Reads two support functions and a displacement. Returns normal, depth and points as any other pair function does.
"""
