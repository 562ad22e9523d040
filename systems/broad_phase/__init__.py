"""Candidate pairs: which bounding boxes overlap, found by brute force, uniform grid, static grid or tree.

Reads positions and shapes, and search bounds where bodies are swept. Writes the boxes and the arrays of candidate
pairs. plan.py says which index a world gets, system.py runs it.
"""
