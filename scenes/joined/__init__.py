"""Joined: bodies that joints hold together, in worlds with the plugin Joints.

A bridge of planks that bears crates, ragdolls that fall down stairs, a car that drives over hills, a crane.
"""
