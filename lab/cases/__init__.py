"""What is to be measured: scenes as subjects, their norms and reference results, and the grid of settings to try.

Reads the library of scenes, files of the user, closed forms and published results. Writes the case that jobs run.
"""
