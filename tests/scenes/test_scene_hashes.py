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
    "bridge": ({"n": 8, "crates": 2}, "ee27fc35ff4b83300c83f279bf423fee1cd0569e0b9f5b5f1173ebc6ac0a59a2"),
    "ragdoll": ({"n": 1}, "9d5e25f64f2ddc11f5b1493a06547beea1a3641496428055a5ae422d78771a9e"),
}
STEPS = 60


@pytest.mark.parametrize("name", list(HASHES))
def test_the_bits_of_a_scene(name):
    sizes, expected = HASHES[name]
    with scenes.get(name).build(**sizes) as world:
        for _ in range(STEPS):
            world.step()
        assert world.state_hash() == expected
