"""1,000 elastic discs in a square box.

``n`` discs of :mod:`carom.scenes.gas`; ``seed`` chooses places and velocities.
"""

from carom.scenes import gas

SECONDS = 10.0
VIEW = gas.view(gas.BODIES[2], 2)
build = gas.gas2d
