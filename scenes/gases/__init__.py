"""Gases: many elastic bodies in a box that only bounce, without gravity.

Kinetic energy is conserved. Most start from :mod:`carom.scenes.gas` and change one thing: the number of dimensions, the
shapes, the speed, or queries in place of motion. They are the benchmarks of finding pairs and of impacts.
"""
