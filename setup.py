"""The wheel: with a library of compiled kernels in the package it is of a platform, for every Python; else pure."""

import os
import sys
from pathlib import Path

from setuptools import Distribution, setup

PACKAGE = Path(__file__).parent / "src" / "carom"
TAG = os.environ.get("CAROM_WHEEL")  # of the platform that the library is for

if not (PACKAGE / "framework").is_dir():  # git on Windows writes links as text files unless told otherwise
    sys.exit("src/carom holds links to the folders beside src: clone with `git clone -c core.symlinks=true`")


class MaybeCompiled(Distribution):
    def has_ext_modules(self):
        return TAG is not None


setup(
    distclass=MaybeCompiled,
    options={"bdist_wheel": {"py_limited_api": "cp311", "plat_name": TAG}} if TAG else {},
)
