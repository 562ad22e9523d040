"""The bits of five scenes: the same on every processor and system, compiled or not.

Whoever means to change what these scenes do writes the new hashes here. Whoever does not, and finds them changed on
another machine alone, has left something to a libm, to BLAS or to a fused multiply-add.
"""

from __future__ import annotations

import pytest

from carom import scenes

HASHES = {
    "pile2d": ({"n": 40}, "37e83a7c66975f55c323e5788a27d4ab2cd94abe007d8d80530fa52e9259fbfb"),
    "pile3d": ({"n": 27}, "31bd1f8666ae9387515ef60f333e81dd6fd6e3fe66bc24700c6c34d2d473ccc7"),
    "tumbler": ({"n": 12}, "0c1980139e89fde1c589cce28d44e01f52c316eeab435314c4e599fccb103c62"),
    "bridge": ({"n": 8, "crates": 2}, "90386a86fe10077d25cae829ab05deebebc7ab7a3b84a2c0095a7c9dafb139d9"),
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
