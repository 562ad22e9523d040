"""One run measured from outside: steps, time, impacts, bodies that escaped, and norms of the error.

Reads worlds (shapes as plain arrays, positions, velocities). Writes records of the run, and changes the world only by
stepping it.
"""
