"""``carom limits``: where carom fails, one axis at a time, and how long the step of a world may be.

Reads worlds made for each axis, the forces of a world and the stability of its integrator. Writes records, tables and
a chart.
"""
