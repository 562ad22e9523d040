"""``carom limits``: where carom fails, one axis at a time, and the longest safe step of a world.

Reads worlds made for each axis, the forces of a world and the stability of its integrator. Writes records, tables and
a chart.
"""
