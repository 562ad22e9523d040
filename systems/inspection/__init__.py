"""Inspection: what a world tells about itself, through ``world.plan()``, ``world.stats()`` and the energies.

Reads the state, the table and the list of stages. Writes nothing but the counters, when they are reset.

Modules: planned_kernels and planned_columns (what a plan lists beside the stages of the systems, and every array with
its reason), counters, energies.
"""
