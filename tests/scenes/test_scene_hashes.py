"""The bits of five scenes: the same on every processor and system, compiled or not.

Whoever means to change what these scenes do writes the new hashes here. Whoever does not, and finds them changed on
another machine alone, has left something to a libm, to BLAS or to a fused multiply-add.
"""

from __future__ import annotations

import pytest

from carom import scenes

HASHES = {
    "pile2d": ({"n": 40}, "43cad55e233dbe63bd82c89017d8282e26d8072413c54e968be12d8dc9a2a35c"),
    "pile3d": ({"n": 27}, "059dd8c48f9f797f3533fa59e5bceeddae6a99cdc98004a8e40695ee056e280a"),
    "tumbler": ({"n": 12}, "0c1980139e89fde1c589cce28d44e01f52c316eeab435314c4e599fccb103c62"),
    "bridge": ({"n": 8, "crates": 2}, "8e60f0e627b5bfbe4e9ecc74e197dd58b15335f1f6d23bfbc530ada4c5a90775"),
    "ragdoll": ({"n": 1}, "a2cb76e518cd3313c77f8fe557cdebc26f4a88a6f7fc091ee8835e6cb1ccdd16"),
}
STEPS = 60


@pytest.mark.parametrize("name", list(HASHES))
def test_the_bits_of_a_scene(name):
    sizes, expected = HASHES[name]
    with scenes.get(name).build(**sizes) as world:
        for _ in range(STEPS):
            world.step()
        assert world.state_hash() == expected
