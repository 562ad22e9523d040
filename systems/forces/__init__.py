"""The first part of a step: forces added up for each body, from gravity, constant and applied forces and force systems.

Reads positions, velocities and masses. Writes the force columns that the integrators use. The conserved quantities
(energy, momentum) are computed here too, from the same columns and potentials.
"""
