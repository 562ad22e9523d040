"""Which geometry levels suit which objects.

Reads convex polygons with their enclosing circles and boxes, and a numpy reference by separating axes. Writes records,
tables and a picture.
"""
