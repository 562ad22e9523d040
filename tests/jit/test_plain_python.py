"""The source of kernels, run by Python as it stands, gives the bits of their machine code.

For a run of the tests with NUMBA_DISABLE_JIT=1, as ``make coverage`` does; else there is nothing to compare.
"""

from __future__ import annotations

from pathlib import Path

import helpers_zoo
import pytest
from helpers_processes import output_of

from carom.framework.jit.lazy import JIT

pytestmark = [
    pytest.mark.plain, pytest.mark.last, pytest.mark.skipif(JIT, reason="the kernels are compiled in this run"),
]  # fmt: skip


@pytest.fixture(scope="module")
def compiled():
    """What another process sees whose kernels are compiled, by scenario."""
    zoo = "import runpy; runpy.run_module('tests.helpers_zoo', run_name='__main__')"
    printed = output_of(zoo, cwd=Path(__file__).parents[2], NUMBA_DISABLE_JIT="0")
    return {line.split(",")[0]: line.split(",")[1:] for line in printed.splitlines()}


@pytest.mark.parametrize(("name", "run"), list(helpers_zoo.scenarios()), ids=lambda value: str(value)[:30])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_the_same_bits(name, run, compiled):
    assert run() == compiled[name]
