"""Where carom fails, one quantity at a time.

Reads worlds made for each quantity. Writes tables and a chart.
"""
