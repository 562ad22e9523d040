"""Cost and benefit of each field of Settings, and the best settings for each kind of game.

Reads small worlds in which a field matters, and the search of ``carom tune``. Writes records and tables.
"""
