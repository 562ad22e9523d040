"""The bits of five scenes: the same on every processor and system, compiled or not.

Whoever means to change what these scenes do writes the new hashes here. Whoever does not, and finds them changed on
another machine alone, has left something to a libm, to BLAS or to a fused multiply-add.
"""

from __future__ import annotations

import pytest

from carom import scenes

HASHES = {
    "pile2d": ({"n": 40}, "e4d685007faf3bd9cdaf4ecfcdd7ec3c53664da884e0bb84be816b37b274673f"),
    "pile3d": ({"n": 27}, "9230a04c971390150c906985c8dacbf885fb40bfdbf4990f712682dc69b8fdb1"),
    "tumbler": ({"n": 12}, "0c1980139e89fde1c589cce28d44e01f52c316eeab435314c4e599fccb103c62"),
    "bridge": ({"n": 8, "crates": 2}, "d65d71345f10be67bfa67220af34c3a067740834575e97b82f41eaad29146c3f"),
    "ragdoll": ({"n": 1}, "98ee53b269a0b1874e1ccb29142ced64902f34ad45001e1ea423f077af7212fd"),
}
STEPS = 60


@pytest.mark.parametrize("name", list(HASHES))
def test_the_bits_of_a_scene(name):
    sizes, expected = HASHES[name]
    with scenes.get(name).build(**sizes) as world:
        for _ in range(STEPS):
            world.step()
        assert world.state_hash() == expected
