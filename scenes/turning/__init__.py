"""Turning: bodies with a Spin, in worlds with the plugin Rotation.

Balls that roll and take spin from friction, flippers that throw them; dominoes, boxes in a tumbler and shapes of all
kinds in a bin, which tip and turn by their contacts.
"""
