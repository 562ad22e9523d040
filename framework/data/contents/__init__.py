"""What a world has in esper: its entities, the members of each component, and the log of what has changed since."""
