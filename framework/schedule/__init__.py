"""The order of a step and its execution: systems sorted into phases, one step run, time accumulated, work measured.

Reads the systems of a world and their phases and priorities. Writes the pipeline that runs them, the clock, the plan of
kernels and columns (``world.plan()``) and the profile (``world.stats()``, ``world.profile()``).
"""
