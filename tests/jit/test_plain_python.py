"""The source of kernels, run by Python as it stands, gives the bits of their machine code.

For a run of the tests with NUMBA_DISABLE_JIT=1, as ``make coverage`` does; else there is nothing to compare.
"""

from __future__ import annotations

from pathlib import Path

import helpers_zoo
import pytest
from helpers_processes import output_of

from carom.framework.jit.lazy import JIT

# Their lines are nearly all run by others, in less time.
LONG = {
    "mixed 2D discrete", "mixed 2D continuous", "mixed 2D event_driven", "mixed 3D discrete", "mixed 3D continuous",
    "levels 2D discrete", "levels 2D event_driven", "levels 3D discrete", "levels 3D continuous", "struck 3D",
    "bullets 3D continuous", "bullets 3D event_driven", "platformer discrete", "platformer event_driven", "buried 2D",
    "buried 3D", "tumbling 2D", "tumbling 3D", "heavy on light 2D", "heavy on light 3D", "break shot 2D discrete",
    "break shot 3D event_driven", "asked 3D", "bullets 2D event_driven", "sleepers 2D discrete",
    "sleepers 3D continuous",
}

pytestmark = [
    pytest.mark.plain, pytest.mark.last, pytest.mark.skipif(JIT, reason="the kernels are compiled in this run"),
]  # fmt: skip


@pytest.fixture(scope="module")
def compiled(request):
    """What another process sees whose kernels are compiled, by scenario."""
    names = [item.callspec.params["name"] for item in request.session.items if item.module is request.module]
    zoo = "import runpy; runpy.run_module('tests.helpers_zoo', run_name='__main__')"
    printed = output_of(zoo, *names, cwd=Path(__file__).parents[2], NUMBA_DISABLE_JIT="0")
    return {line.split(",")[0]: line.split(",")[1:] for line in printed.splitlines()}


@pytest.mark.parametrize(("name", "run"), [
    pytest.param(*one, id=one[0], marks=[pytest.mark.long] * (one[0] in LONG)) for one in helpers_zoo.scenarios()
])  # fmt: skip
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_the_same_bits(name, run, compiled):
    assert run() == compiled[name]
