"""Drawing with matplotlib: the sheet, projection, marks, the pictures of a run, and the styles of curves.

Reads the shapes and paths of a run. Writes PNG files. Only this folder and the charts of other
folders import matplotlib.
"""
