"""The spatial tree (quadtree, octree): boxes sorted by cell code, pairs and query results found in runs of cells.

Reads corners of boxes. Writes the sorted codes (build), pairs (pairs, refine) and query results (queries).
"""
