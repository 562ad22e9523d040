"""Bodies of several parts: rows of their own, each with a shape, that move as one body.

A row of a part is a copy of its body's, with the collider at an offset: it has the body's place, velocity, spin, mass
and path, and the rotation that the part has against it. So all geometry, and how impulses turn a body, are those of any
collider beside its body's centre. What is done to a row by impacts is done to all rows of its body; the solver and the
groups of impacts know the body's row alone (``owner_of``).

Reads and writes all that moves bodies; ``state.has_parts`` says whether there are any such.
"""
