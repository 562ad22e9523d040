"""Worlds in 3D: a camera that goes round them, triangles of what a drawing list has, and shaded solids by moderngl.

What is drawn is drawn off-screen and copied onto a surface, so windows, films and tools are the same as in 2D.
"""
