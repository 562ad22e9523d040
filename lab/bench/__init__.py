"""``carom bench``: the timed scenes, the records of the results, their tables and charts.

Reads the scene library, and pymunk if it is installed.
"""
