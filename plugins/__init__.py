"""Plugins that ship with carom; all use only the public registry."""

from .physics import Physics

__all__ = ["Physics"]
