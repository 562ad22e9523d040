"""The build that checks every index (CAROM_CHECK=1), for this processor: the same bits as what ships, made for any
processor without checks, and no kernel leaves its arrays.

In 2D: `make coverage` checks the indices of both, as Python does.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers_determinism import Facade, mixed_scene, settled
from helpers_processes import NATIVE, output_of

pytestmark = [pytest.mark.long, pytest.mark.early]  # compiles everything

MIXED = """
from helpers_determinism import Facade, mixed_scene, settled
world = settled()
for _ in mixed_scene(world, Facade(world)): pass
from carom.framework.compilation import log
print(world.state_hash(), len(log.compiled), log.loaded)
"""
POISON = "import runpy; runpy.run_module('world.helpers_poison', run_name='__main__')"
EXTREMES = "contacts/test_caught.py", "impacts/test_continuous_extremes.py", "world/test_extremes.py"
LAWS = "laws/test_bounded.py", "laws/test_containment.py::test_nothing_leaves_a_room_at_any_speed"
TESTS = """
import pytest, sys
class Flat:
    def pytest_collection_modifyitems(self, items):
        items[:] = [item for item in items if not hasattr(item, "callspec") or item.callspec.params.get("d") != 3]
bare = ["--quiet", "--noconftest", "-p", "no:xdist", "-p", "no:cacheprovider", "-m", "not slow and not long"]
sys.exit(pytest.main([*bare, *sys.argv[1:]], plugins=[Flat()]))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("kernels")


def run_checked(folder, code, *arguments, seed="0"):
    """What the program prints, in a new Python with the checked build."""
    optimised = {"NUMBA_OPT": "1"}  # a little, as most of the time goes to compiling
    environment = {"CAROM_CACHE_DIR": str(folder), "CAROM_CHECK": "1", "PYTHONHASHSEED": seed}
    environment |= {"CAROM_BACKGROUND": "0", **optimised, **NATIVE}
    return output_of(code, *arguments, **environment, PYTHONPATH=str(Path(__file__).parents[1]))


def test_other_processes_with_a_cold_and_a_warm_cache_get_the_same_bits(folder):
    """And the same as in this process: without checks, optimised, for any processor."""
    cold, warm = (run_checked(folder, MIXED, seed=seed).split() for seed in ("1", "2"))
    assert int(cold[1]) > 5
    assert int(warm[1]) == 0  # every kernel came from the disk
    assert int(warm[2]) >= int(cold[1])
    world = settled()
    for _ in mixed_scene(world, Facade(world)):
        pass
    assert cold[0] == warm[0] == world.state_hash()


def test_no_kernel_leaves_its_arrays(folder):
    """Whatever stands in any column of some bodies of each scene; the others are as test_quarantine asks."""
    assert run_checked(folder, POISON, 8, "2D") == ""


@pytest.mark.parametrize("names", [EXTREMES, LAWS], ids=["extremes", "laws"])
def test_extremes_and_random_worlds_stay_in_their_arrays(folder, names):
    """Gravity, masses, sizes and speeds far apart, caught bodies, bodies that come and go, scattered shapes."""
    files = [Path(__file__).parents[1] / name for name in names]
    assert " passed" in run_checked(folder, TESTS, *files)
