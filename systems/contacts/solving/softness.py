"""How soft contacts at rest are: springs whose frequency follows the rate of the substeps."""

from __future__ import annotations

import math

FREQUENCY = 0.25  # of the soft contact, times the rate of the substeps
DAMPING_RATIO = 10.0
SAG = 1.0 / (2.0 * math.pi * FREQUENCY) ** 2  # of a contact that bears an impulse per substep: times substep / mass
