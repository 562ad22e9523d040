"""The solver of contacts at rest: rows in islands, solved in substeps.

Reads the contacts at rest with normal and gap where the step starts, the velocities there, the mean acceleration of the
step, and the impulses of the last one. Writes into its own records (``records.py``) the shift and the velocity of each
body, and the impulses.

``islands.order_rows`` joins rows into islands, chooses the substeps of each and sorts the rows. Then
``solver.solve_contacts`` runs ``solver.solve_substep`` for each island and substep:

1. ``apply_forces``.
2. ``apply_warm_start``: the impulses of the last substep.
3. ``solve_passes`` that push: closing rows stop, overlapping rows part like an overdamped spring.
4. ``integrate_positions``, ``measure``: the bodies move; what each row may close from there.
5. ``solve_passes`` that relax, two, four in the last substep, one where bodies spin: the speed of pushing is taken
   back.
6. ``guard.finish_substep``: further passes over islands that gained energy, or whose rows are far from solved; then
   the bound on their energy.

A pass (``passes``) is ``rows.solve_normals`` and ``rows.solve_friction``. How a row moves its bodies is
``rows.closing_speed`` and ``rows.apply_impulse``, and for many spinning bodies at once, with the same bits,
``chunks.solve_two`` and ``solve_one``, and ``fours`` for pairs of four points; nowhere else. Rows of joints are in
``systems/joints``; where there are some, ``turning`` turns bodies in space. ``hard`` chooses contacts that do not sag.
``warm_start`` keeps impulses between steps, ``prediction`` corrects the flight of what they held.
"""
