"""Continuous collision detection: where a body may be within a step, and when two bodies first touch.

Reads the trajectories of the step. Writes the search bounds that the broad phase takes, the time of impact of a pair,
and the candidate pairs that are added when an impact deflects a body out of its search bounds.
"""
