"""``carom geometry``: which levels of collision geometry suit which objects.

Reads convex polygons with the circles and boxes that enclose them, and a reference by separating axes in numpy. Writes
records, tables and a picture.
"""
