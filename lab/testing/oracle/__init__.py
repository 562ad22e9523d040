"""The whole step in plain Python, for small scenes; the compiled systems must agree with it.

Reads a copy of a small world. Computes forces, motion, sweeps, impacts and contacts at rest without compiled code.
"""
