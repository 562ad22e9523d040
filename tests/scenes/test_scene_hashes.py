"""The bits of five scenes: the same on every processor and system, compiled or not.

Whoever means to change what these scenes do writes the new hashes here. Whoever does not, and finds them changed on
another machine alone, has left something to a libm, to BLAS or to a fused multiply-add.
"""

from __future__ import annotations

import pytest

from carom import scenes

HASHES = {
    "pile2d": ({"n": 40}, "9142b236a207b714a281488ae95160caf4b25b2bf35df15695683925505c69c9"),
    "pile3d": ({"n": 27}, "8dd881f2fba79a68a9e253abf8600714554a4b1fdb75dead1382c086a0386a12"),
    "tumbler": ({"n": 12}, "0c1980139e89fde1c589cce28d44e01f52c316eeab435314c4e599fccb103c62"),
    "bridge": ({"n": 8, "crates": 2}, "f9ce66209486f0101560a32992fbb34c691fc66ca30616739b9d399df4e8acf8"),
    "ragdoll": ({"n": 1}, "3f26a14796fcf79599b27e0c71157fbd6f34a956ad4e83a4fe7cdd5356adffeb"),
}
STEPS = 60


@pytest.mark.parametrize("name", list(HASHES))
def test_the_bits_of_a_scene(name):
    sizes, expected = HASHES[name]
    with scenes.get(name).build(**sizes) as world:
        for _ in range(STEPS):
            world.step()
        assert world.state_hash() == expected
