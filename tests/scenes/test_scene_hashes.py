"""The bits of five scenes: the same on every processor and system, compiled or not.

Whoever means to change what these scenes do writes the new hashes here. Whoever does not, and finds them changed on
another machine alone, has left something to a libm, to BLAS or to a fused multiply-add.
"""

from __future__ import annotations

import pytest

from carom import scenes

HASHES = {
    "pile2d": ({"n": 40}, "db9b1fa37750d253586190e5ecd27710ec7762a7ba553529d2497c98fd04f62e"),
    "pile3d": ({"n": 27}, "9ad266244af78d058c9aa2d952f57397bda578cb94a123711b905e59024ddbbe"),
    "tumbler": ({"n": 12}, "0c1980139e89fde1c589cce28d44e01f52c316eeab435314c4e599fccb103c62"),
    "bridge": ({"n": 8, "crates": 2}, "7b974753b6372f34ce8be2475462266e7713eb3a797772518304388d06facc04"),
    "ragdoll": ({"n": 1}, "a9e9c205ab054056285aac4404ad19f7c768d7097e3e4ea4eb5933623dfbbcda"),
}
STEPS = 60


@pytest.mark.parametrize("name", list(HASHES))
def test_the_bits_of_a_scene(name):
    sizes, expected = HASHES[name]
    with scenes.get(name).build(**sizes) as world:
        for _ in range(STEPS):
            world.step()
        assert world.state_hash() == expected
