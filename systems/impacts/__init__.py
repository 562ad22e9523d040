"""Impacts in the order of time within a step: each is found, its impulse applied, and both bodies searched again.

Reads candidate pairs and trajectories. Writes velocities, trajectories and the events of impacts. The queue is a heap
of times; kernels: worklist holds pairs, find makes their events, stages takes them off the queue. Impacts at the same
time are carried out together: together finds them, group solves those that share a body. Else impulses
has what one of them does, turning the same for bodies that spin, jointed for those that joints hold (joint_answers).
"""
