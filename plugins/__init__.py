"""Plugins that ship with carom; all stand on the public registry alone."""

from .physics import Physics

__all__ = ["Physics"]
