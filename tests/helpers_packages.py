"""Wheels and archives of the sources, built in a copy: nothing is left behind in the checkout."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from helpers_folders import ROOT

LEFT_OUT = shutil.ignore_patterns(".*", "dist", "out", "*.egg-info", "__pycache__", "uv.lock", "_kernels.*")


def copied_sources(folder: Path) -> Path:
    shutil.copytree(ROOT, folder, symlinks=True, ignore=LEFT_OUT)
    shutil.rmtree(folder / "build", ignore_errors=True)  # not lab/build
    return folder


def build(kind: str, source: Path, target: Path) -> Path:
    """Call setuptools' own build hooks, the ones pip calls: no network, no isolated environment."""
    code = f"import sys, setuptools.build_meta as b; print(b.build_{kind}(sys.argv[1]))"
    command = [sys.executable, "-c", code, str(target)]
    result = subprocess.run(command, cwd=source, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": ""})
    assert result.returncode == 0, result.stderr
    return target / result.stdout.strip().splitlines()[-1]
