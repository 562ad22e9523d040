"""Plugins that ship with carom. All use only the public registry, but Physics, which also sets ``world.physics``."""

from .physics import Physics

__all__ = ["Physics"]
