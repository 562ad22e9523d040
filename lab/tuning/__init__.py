"""``carom tune``: the cheapest settings that keep an error limit, found by search, and checked on other scenes.

Reads the results of jobs. Writes a report, and the line of code that sets the settings.
"""
