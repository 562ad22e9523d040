"""The bits of five scenes: the same on every processor and system, compiled or not.

Whoever means to change what these scenes do writes the new hashes here. Whoever does not, and finds them changed on
another machine alone, has left something to a libm, to BLAS or to a fused multiply-add.
"""

from __future__ import annotations

import pytest

from carom import scenes

HASHES = {
    "pile2d": ({"n": 40}, "e1f24cf748c2498c94db16321141435a51433acf680f5b48024c365de7b970a9"),
    "pile3d": ({"n": 27}, "cab0d89851ae420ef135f53298726e508c298dcf1f3f717bb124baaf2908392b"),
    "tumbler": ({"n": 12}, "0c1980139e89fde1c589cce28d44e01f52c316eeab435314c4e599fccb103c62"),
    "bridge": ({"n": 8, "crates": 2}, "13bf94e626147b1517fb307cd0608a3d8ec0945c8f392456ac5c43341bfd9404"),
    "ragdoll": ({"n": 1}, "de743f5efcba4ed41888d4a8590839b475e44f4c8fe3caadd0b6517e8826df34"),
}
STEPS = 60


@pytest.mark.parametrize("name", list(HASHES))
def test_the_bits_of_a_scene(name):
    sizes, expected = HASHES[name]
    with scenes.get(name).build(**sizes) as world:
        for _ in range(STEPS):
            world.step()
        assert world.state_hash() == expected
