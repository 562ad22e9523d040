"""``carom plugins`` and ``carom plugins check``: list the installed plugins, and check one plugin's functions.

Reads a plugin's shapes and pairs, compiles them and calls them with random and extreme inputs. Writes findings.
"""
