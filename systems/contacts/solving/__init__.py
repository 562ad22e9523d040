"""The solver for contacts at rest: soft and rigid ones, light bodies between heavy ones, and what it starts with."""
