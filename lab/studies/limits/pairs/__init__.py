"""The axes crossed in pairs, by a seeded random sweep of short scenes.

Reads a seed and scene numbers; each scene is drawn from these two alone. Writes what became of each scene, and tables
by collision mode and by pair of axes.
"""
