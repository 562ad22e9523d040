"""carom and pymunk behind one interface: the same bodies, the same quality measure, the same work counts.

Reads a world of carom as plain arrays. Writes the equivalent pymunk space, and the compared figures for both.
"""
