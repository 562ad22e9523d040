"""Joints in the solver: rows beside those of contacts, in the same islands and substeps.

``bodies`` finds those that take part in a step and where they hold their bodies, ``rows`` measures and solves them,
with ``springs``; ``own`` is what a plugin's joint is, ``linked`` and ``given`` call its function. The kinds of joints
are components, and who writes the rows: see plugins/joints.
"""
