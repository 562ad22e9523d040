"""Impacts in the order of time within a step: each is found, its impulse applied, and both bodies searched again.

Reads candidate pairs and trajectories. Writes velocities, trajectories and the events of impacts. The queue is a heap
of times; kernels: find, then queue and impulses for each event.
"""
