"""``carom bench``: the timed scenes, the records of the results, their tables and charts.

Reads the scene library. The benchmarks are in the folder ``benchmarks``, one per file.
"""
