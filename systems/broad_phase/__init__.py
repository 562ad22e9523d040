"""Candidate pairs: which bounding boxes overlap, found by brute force, uniform grid, static grid or tree.

Reads positions and shapes, and search bounds where bodies are swept. Writes the boxes and the candidate pairs.

boxes.py makes the boxes, stages.py decides how to search and holds the stages, in the order in which they run;
brute_force.py, uniform_grid.py and static_grid.py are what these stages call. tree/ is for boxes that suit no grid:
search.py drives it from Python, owns all memory, calls broad phases of plugins and has the indexes for queries.
system.py lists the stages.
"""
