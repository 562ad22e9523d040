"""10,000 elastic spheres in a cube.

``n`` spheres of :mod:`carom.scenes.gas`; ``seed`` chooses places and velocities.
"""

from carom.scenes import gas

SECONDS = 5.0
VIEW = gas.view(gas.BODIES[3], 3)
build = gas.gas3d
