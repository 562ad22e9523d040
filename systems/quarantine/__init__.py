"""Bodies with values that cannot be: how they are found, and how they are taken out of a step."""
