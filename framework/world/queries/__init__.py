"""Queries of a world: the verbs, what they take, what they find, and casts."""
