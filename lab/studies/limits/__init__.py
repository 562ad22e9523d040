"""Where carom fails, one axis at a time.

Reads worlds made for each axis. Writes records, tables and a chart.
"""
