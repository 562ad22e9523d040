"""Runs on all cores: tasks, worker processes, and the store that keeps each result so that nothing runs twice.

Reads cases and cells of the grid. Writes results into the store's file as they come.
"""
