"""What a plugin may add (shapes, pairs, sweeps, filters, integrators, systems, joints), and the registry of a world.

Reads the plugins that a world is given and the entry points of installed packages. Checks each function when it is
registered, and writes the registry, which the systems read when they generate their kernels.
"""
