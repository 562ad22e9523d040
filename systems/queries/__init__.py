"""Queries of a world between steps: overlap, nearest surfaces, neighbours, ray and shape casts.

A batch of queries is a record (:mod:`.records`); the verbs write its rows, one call of a compiled function writes what
is found, and Python copies that. The functions know no shapes: :mod:`carom.systems.shapes.query` evaluates the query
shape against those of bodies through tables of addresses. Each goes through two indexes of the broad phase, of what
moves and of what does not: grids, brought up to date by the first query after a change, or trees where there is none.

- :mod:`.overlap`: what touches a shape, and bodies near bodies; :mod:`.nearest`: the nearest surface
- :mod:`.casts`: along the path, with :mod:`.first_touch` for each body that comes near
- :mod:`.candidates`: what these share; :mod:`.kernels`: how Python calls them
- :mod:`.batch`: memory of batches, query shapes; :mod:`.system`: the verbs

Reads positions, offsets, shapes, their parameters and layers. Writes the record of the batch, and of the state the
trace that errors name (``row_a`` to ``unsound_b``).
"""
