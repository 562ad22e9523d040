"""Impacts: one by one, many in one step, or too fast for discrete collisions.

Mostly few bodies, whose velocities, positions or number of impacts are known exactly. The scenes show what a collision
mode detects, in which order impacts are resolved, and how a bounce changes energy.
"""
