"""The bits of five scenes: the same on every processor and system, compiled or not.

Whoever means to change what these scenes do writes the new hashes here. Whoever does not, and finds them changed on
another machine alone, has left something to a libm, to BLAS or to a fused multiply-add.
"""

from __future__ import annotations

import pytest

from carom import scenes

HASHES = {
    "pile2d": ({"n": 40}, "cd7509a1e0ebf3e8dd650f971ed439fba1a9b4cd4e1653bde781d6d0e52ec160"),
    "pile3d": ({"n": 27}, "209d2ed3b3a57a71d14a8cbbb6a538736b091f19cab922dc3fa4766712647a2b"),
    "tumbler": ({"n": 12}, "0c1980139e89fde1c589cce28d44e01f52c316eeab435314c4e599fccb103c62"),
    "bridge": ({"n": 8, "crates": 2}, "3bbdbc989a745f5000ceb692967d1f8ecab7b283a805ba952c2a92361a33e3a6"),
    "ragdoll": ({"n": 1}, "72b6f74d1b488d07880bc6b6263df96570b0936e178aa2cc37630a937483eb8a"),
}
STEPS = 60


@pytest.mark.parametrize("name", list(HASHES))
def test_the_bits_of_a_scene(name):
    sizes, expected = HASHES[name]
    with scenes.get(name).build(**sizes) as world:
        for _ in range(STEPS):
            world.step()
        assert world.state_hash() == expected
