"""The wheel: with compiled kernels in framework/prebuilt it is one of this platform and Python version, else pure."""

import sys
from pathlib import Path

from setuptools import Distribution, setup

FRAMEWORK = Path(__file__).parent / "src" / "carom" / "framework"
PREBUILT = FRAMEWORK / "prebuilt" / "index.json"

if not FRAMEWORK.is_dir():  # git on Windows writes links as text files unless told otherwise
    sys.exit("src/carom holds links to the folders beside src: clone with `git clone -c core.symlinks=true`")


class MaybeCompiled(Distribution):
    def has_ext_modules(self):
        return PREBUILT.exists()


setup(distclass=MaybeCompiled)
