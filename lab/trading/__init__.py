"""``carom trade``: the trade-off between speed and accuracy, measured over a grid of settings.

Reads the results of jobs and the clock. Writes records, tables, charts, a page, JSON and CSV.
"""
