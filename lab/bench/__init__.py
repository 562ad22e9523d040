"""``carom bench``: the scenes that are timed, the records of the results, their tables and charts.

Reads the library of scenes. The benchmarks themselves are in the folder ``benchmarks``, one in each file.
"""
