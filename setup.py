"""The wheel: with compiled kernels in framework/prebuilt it is one of this platform and Python version, else pure."""

from pathlib import Path

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel

PREBUILT = Path(__file__).parent / "framework" / "prebuilt" / "index.json"


class Wheel(bdist_wheel):
    def finalize_options(self):
        super().finalize_options()
        self.root_is_pure = not PREBUILT.exists()


setup(cmdclass={"bdist_wheel": Wheel})
