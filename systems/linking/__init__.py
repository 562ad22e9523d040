"""What a world calls by address: found out from its scene, compiled or loaded, and written into its records.

``steps`` follows the scene and links what the next step needs; ``preparation`` links ahead what later steps and queries
may need; ``parts`` are parts of stages that are linked on their own.
"""
