"""``carom plugins`` and ``carom plugins check``: which plugins are installed, and whether one does what it must.

Reads a plugin's shapes and pairs; compiles them and calls them with random and extreme inputs. Writes findings.
"""
