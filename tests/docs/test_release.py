"""What stands in the way of a release is found before anything is built, and what is wrong with what was built."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import pytest

from studies.release import findings, wheel_findings

LOG = "# Changelog\n\n## 0.2.0 (2026-12-01)\n\n- One more.\n\n## 0.1.0 (2026-11-01)\n\n- All.\n"


def git(root: Path, *arguments: str) -> None:
    who = ("-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false", "-c", "tag.gpgsign=false")
    subprocess.run(["git", *who, *arguments], cwd=root, check=True, capture_output=True)


@pytest.fixture
def checkout(tmp_path) -> Path:
    (tmp_path / "src" / "carom").mkdir(parents=True)
    (tmp_path / "src" / "carom" / "__init__.py").write_text('__version__ = "0.2.0"\n')
    (tmp_path / "CHANGELOG.md").write_text(LOG)
    git(tmp_path, "init", "--quiet")
    git(tmp_path, "add", "--all")
    git(tmp_path, "commit", "--quiet", "--message", "all")
    return tmp_path


def test_nothing_stands_in_the_way_of_a_good_release(checkout):
    assert findings("0.2.0", checkout) == []


def test_each_thing_in_the_way_is_named(checkout):
    assert findings("0.2", checkout)[0] == "0.2: a version is three numbers, and perhaps a1, b1 or rc1"
    assert findings("0.3.0", checkout) == [
        "src/carom/__init__.py says 0.2.0, not 0.3.0",
        "the first section of CHANGELOG.md is '0.2.0 (2026-12-01)', not '0.3.0 (YYYY-MM-DD)'",
    ]
    git(checkout, "tag", "v0.2.0")
    assert findings("0.2.0", checkout) == ["there is a tag v0.2.0 already"]
    git(checkout, "tag", "--delete", "v0.2.0")
    (checkout / "CHANGELOG.md").write_text(LOG.replace("- One more.\n", ""))
    assert findings("0.2.0", checkout) == [
        "the checkout is not clean: CHANGELOG.md", "CHANGELOG.md says nothing about 0.2.0",
    ]  # fmt: skip
    (checkout / "CHANGELOG.md").write_text(LOG.replace("2026-12-01", "unreleased"))
    assert "not '0.2.0 (YYYY-MM-DD)'" in findings("0.2.0", checkout)[1]


METADATA = "Metadata-Version: 2.4\nName: carom\nVersion: 0.2.0\nSummary: s\nLicense-Expression: MIT\n"
FILES = {
    "carom/__init__.py": "", "carom/__init__.pyi": "", "carom/py.typed": "", "carom/_kernels.abi3.so": "code",
    "carom-0.2.0.dist-info/licenses/LICENSE": "MIT",
    "carom-0.2.0.dist-info/METADATA": METADATA + "Classifier: Typing :: Typed\nRequires-Python: >=3.11\n",
}  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({}, []),
        ({"tests/test_x.py": ""}, ["tests/test_x.py is in it"]),
        ({"carom/py.typed": None}, ["carom/py.typed is missing"]),
        ({"carom/_kernels.abi3.so": None}, ["it has not one library of kernels"]),
        ({"carom-0.2.0.dist-info/METADATA": METADATA}, ["no Classifier", "it is 0.2.0 for Python None"]),
        ({"carom-0.2.0.dist-info/METADATA": None}, ["no carom-0.2.0.dist-info"]),
    ],
)
def test_the_contents_of_a_wheel_are_looked_at(tmp_path, changes, found):
    wheel = tmp_path / "carom-0.2.0-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, content in {**FILES, **changes}.items():
            if content is not None:
                archive.writestr(name, content)
    assert wheel_findings(wheel, "0.2.0") == [f"{wheel.name}: {each}" for each in found]
