"""The wheel: with compiled kernels in framework/prebuilt it is one of this platform and Python version, else pure."""

from pathlib import Path

from setuptools import Distribution, setup

PREBUILT = Path(__file__).parent / "framework" / "prebuilt" / "index.json"


class MaybeCompiled(Distribution):
    def has_ext_modules(self):
        return PREBUILT.exists()


setup(distclass=MaybeCompiled)
