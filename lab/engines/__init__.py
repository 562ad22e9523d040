"""carom and pymunk behind one interface: the same bodies, the same measure of quality, the same count of work.

Reads a world of carom as plain arrays. Writes the equal space of pymunk, and for both the figures that are compared.
"""
