"""The bits of five scenes: the same on every processor and system, compiled or not.

Whoever means to change what these scenes do writes the new hashes here. Whoever does not, and finds them changed on
another machine alone, has left something to a libm, to BLAS or to a fused multiply-add.
"""

from __future__ import annotations

import pytest

from carom import scenes

HASHES = {
    "pile2d": ({"n": 40}, "0aa00ce13adbdce832b73464c7130bd7a97ad99ad58cfc1ee88787df4601e4a2"),
    "pile3d": ({"n": 27}, "e4300420ce26b5aeb4f1edcdd696e3de5685e6fdb56dc708878a2864b2334ad6"),
    "tumbler": ({"n": 12}, "0c1980139e89fde1c589cce28d44e01f52c316eeab435314c4e599fccb103c62"),
    "bridge": ({"n": 8, "crates": 2}, "162d6e999eae9b029ff31922af3cbf61c4c9facc67f0557b3017b308221cd5c1"),
    "ragdoll": ({"n": 1}, "4942aef46c067cc8ef4e372242e1630f867d6945d5bde5d21f5940047c179c0e"),
}
STEPS = 60


@pytest.mark.parametrize("name", list(HASHES))
def test_the_bits_of_a_scene(name):
    sizes, expected = HASHES[name]
    with scenes.get(name).build(**sizes) as world:
        for _ in range(STEPS):
            world.step()
        assert world.state_hash() == expected
