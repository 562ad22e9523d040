"""What is small for two bodies: their sizes, and the distances that follow from these."""

from __future__ import annotations

from ...framework.compilation import inlined

SLOP = 0.005  # of the size of the smaller body
MARGIN_STEPS = 2.0


@inlined
def smaller(a, b, size):
    """The size of the smaller body; a point takes that of the other."""
    one, other = size[a], size[b]
    return min(one, other) if one > 0.0 and other > 0.0 else max(one, other)


@inlined
def slop_of(a, b, size, fixed):
    """Metres that are nothing to this pair: as the settings say, or from the sizes."""
    return fixed if fixed >= 0.0 else SLOP * smaller(a, b, size)


@inlined
def reach(dt, a, b, share, size, fixed_slop):
    """How near a pair is held before it touches: the slop, and twice the way that forces make in a step from rest.

    share (n,): what forces change of a body's speed in a step.
    """
    return slop_of(a, b, size, fixed_slop) + MARGIN_STEPS * max(share[a], share[b]) * dt
