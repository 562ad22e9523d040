"""Linking: the functions of plugins, compiled once per shape or pair, and the tables through which kernels find them.

Reads the registered shapes, pairs and rules of mixing, and the columns of colliders. Writes the linked functions, the
tables of their addresses and the parameter records.

Modules, each using those before it: user_functions, source, parameters (records of the shapes' columns), signatures,
convex_by_address (for the pair of any two convex shapes), batches, linked_pair, linked_shape, mixing, linked_shapes.
"""
