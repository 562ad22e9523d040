"""Contacts: the exact test of each candidate pair.

Reads candidate pairs, shapes, layers, masks and pair filters. Writes the buffers of contacts (bodies, normal, depth,
points, material), in an order that does not depend on the order in which bodies were created.
"""
