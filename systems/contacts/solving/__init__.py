"""The solver for contacts at rest: soft, firm and rigid ones, light bodies between heavy ones, and their warm start."""
