"""``carom limits``: how long a scene's step may be, and what limits it.

Reads the forces of a world, the stability of its integrator, and runs of the scene. Writes records in words.
"""
