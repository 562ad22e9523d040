"""``studies accuracy``: the trade-off of scenes with a known answer, in short tables, beside published results.

Reads the studies of :mod:`carom.lab.trading` and published figures. Writes the tables and charts of docs/accuracy.md.
"""
