"""``carom settings``: what each field of Settings costs and buys, and which settings suit which kind of game.

Reads small worlds in which a field matters, and the search of tuning. Writes records and tables.
"""
