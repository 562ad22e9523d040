"""What snapshots hold of entities and of the table, and how both go back to it.

``population`` reads and writes esper's entities and the handles of their components, ``table`` the columns. Neither
knows of physics; ``world/snapshots.py`` puts a world's state together.
"""
