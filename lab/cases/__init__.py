"""What to measure: scenes as subjects, their norms and reference results, and the grid of settings to try.

Reads the scene library, user files, closed forms and published results. Writes the case that jobs run.
"""
