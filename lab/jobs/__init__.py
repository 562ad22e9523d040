"""Runs on all cores: tasks, worker processes, and the store that keeps each result so that no run is repeated.

Reads cases and cells of the grid. Writes each result into the store's file as it arrives.
"""
