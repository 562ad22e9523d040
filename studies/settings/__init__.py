"""What each field of Settings costs and buys: each is varied alone, in scenes where it matters.

Reads scenes of the library and small worlds of its own. Writes tables.
"""

from .fields import axes
from .tables import report

__all__ = ["axes", "report"]
