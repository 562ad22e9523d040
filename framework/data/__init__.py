"""Where the state of a world is kept: columns of arrays, one table of bodies, components as views of its rows.

Reads what users write into components and what esper reports as added or removed. Writes the columns that the systems
and their kernels work on, and keeps entity, component and row in step (adoption). Knows no step and no physics.
"""
