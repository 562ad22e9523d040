"""The source of kernels, run by Python as it stands, gives the bits of their machine code.

For a run of the tests with NUMBA_DISABLE_JIT=1, as ``make coverage`` does; else there is nothing to compare.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import helpers_zoo
import pytest

from carom.framework.jit.lazy import JIT

pytestmark = [
    pytest.mark.plain, pytest.mark.last, pytest.mark.skipif(JIT, reason="the kernels are compiled in this run"),
]  # fmt: skip


@pytest.fixture(scope="module")
def compiled():
    """What another process sees whose kernels are compiled, by scenario."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.helpers_zoo"], env={**os.environ, "NUMBA_DISABLE_JIT": "0"},
        cwd=Path(__file__).parents[2], capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return {line.split(",")[0]: line.split(",")[1:] for line in done.stdout.splitlines()}


@pytest.mark.parametrize(("name", "run"), list(helpers_zoo.scenarios()), ids=lambda value: str(value)[:30])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_the_same_bits(name, run, compiled):
    assert run() == compiled[name]
