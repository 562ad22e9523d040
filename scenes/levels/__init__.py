"""Levels: worlds as games have them, mostly large, or with systems of their own.

A maze, a level of static boxes, and a player with a radar among thousands of objects; crates on ledges, on a belt of
kinematic slats and on lifts, which the scene's own systems move.
"""
