"""Motion: forces and integrators, with few contacts or none.

Bodies that fall or jump, a body on a spring, a planet on its orbit. The exact paths are known, so the scenes show the
error and the cost of an integrator.
"""
