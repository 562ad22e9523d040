"""What to measure: scenes as subjects, their norms and reference results, and the grid of settings to try.

Reads the scene library, user files and closed forms. Writes the case that jobs run.
"""
