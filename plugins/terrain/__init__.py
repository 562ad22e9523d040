"""Terrain: ground of many pieces that bodies roll and slide over without catching where the pieces meet."""

from .chain import create_chain
from .segment import ChainSegmentCollider, plugin

__all__ = ["ChainSegmentCollider", "create_chain", "plugin"]
