"""Worlds in 2D: what a drawing list has, painted by pygame shape by shape, or by pyglet as triangles in one call."""
