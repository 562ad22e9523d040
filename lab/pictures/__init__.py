"""Drawing with matplotlib: the sheet, projection, marks, and the pictures of a run.

Reads the shapes and paths of a run. Writes PNG files. Only this folder and the charts of other
folders import matplotlib.
"""
