"""Motion without contacts: integrators, bodies in flight between events, and the path of each body within the step.

Reads positions, velocities and forces. Writes new positions and velocities, and the coefficients of the trajectory (a
line, a parabola or a cubic) on which impacts find their time.
"""
