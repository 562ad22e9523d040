"""carom against pymunk and Box2D, on the same bodies in one process.

:mod:`plain` reads a world's bodies and joints, :mod:`engines` builds them again in each engine, :mod:`quality` judges
their states by one measure, :mod:`suite` lists what is timed, :mod:`timing` takes the times and writes the tables.
"""
