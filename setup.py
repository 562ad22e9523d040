"""Everything that setuptools needs is in pyproject.toml, but for two things."""

import sys
import tempfile
from pathlib import Path

from setuptools import setup

if not (Path(__file__).parent / "src" / "carom" / "framework").is_dir():  # git on Windows writes links as text files
    sys.exit("src/carom holds links to the folders beside src: clone with `git clone -c core.symlinks=true`")

with tempfile.TemporaryDirectory() as folder:  # else a wheel would hold what a former build left
    setup(options={"build": {"build_base": folder}})
