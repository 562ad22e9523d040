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
    "bridge": ({"n": 8, "crates": 2}, "ba276f9c84b736f024820cb481f6cd1ac45ca47d5145949e5eea8bdf0830528c"),
    "ragdoll": ({"n": 1}, "06e5ed38d62cad6723882e4d0e7e28502a315134c4aac8bed0490ba662eccd3d"),
}
STEPS = 60


@pytest.mark.parametrize("name", list(HASHES))
def test_the_bits_of_a_scene(name):
    sizes, expected = HASHES[name]
    with scenes.get(name).build(**sizes) as world:
        for _ in range(STEPS):
            world.step()
        assert world.state_hash() == expected
