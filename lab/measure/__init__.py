"""One run measured from outside: steps, time, impacts, bodies that escaped, and norms of the error.

Reads worlds (shapes as plain arrays, positions, velocities). Writes records of what the run showed, and changes nothing
in the world but by its steps.
"""
