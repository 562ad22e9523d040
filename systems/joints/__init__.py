"""Joints in the solver: rows beside those of contacts, in the same islands and substeps.

``bodies`` finds those that take part in a step and where they hold their bodies, ``rows`` measures and solves them,
``coupling`` and ``direct`` those of one joint, or of many, at once; ``own`` is what a plugin's joint is, ``custom``
calls its function. The kinds of joints are components, and who writes the rows: see plugins/joints.
"""
