"""The spatial tree (quadtree, octree): boxes in the order of their cells; pairs are runs of cells.

Takes corners of boxes; everything is in one record, ``TREE``. tree.py is the Python side, and how it calls
kernels. These are, in order: build (and refine, in Python, for uneven scenes), pairs (ranges first, then tests).
cells.py says which cells a box may meet; queries of bodies walk through the tree with it.
"""
