"""The first part of a step: forces added up for each body, from gravity, constant and applied forces and force systems.

Reads positions, velocities and masses. Writes the force columns that the integrators use.
"""
