"""Maps of level editors, loaded into a world."""
