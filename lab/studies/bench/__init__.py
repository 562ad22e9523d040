"""Benchmarks of single features: the ladder of features, kinds of collisions, pairs of plugins.

Each reads worlds of its own and the clock, and returns records with their table.
"""
