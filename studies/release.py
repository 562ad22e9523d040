"""``python -m studies.release VERSION``: make a release of carom, or say what is in its way; see docs/releases.md."""

from __future__ import annotations

import email
import hashlib
import importlib.util
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import click

from carom.framework.jit.libraries import NAME
from carom.lab.build.platforms import PLATFORMS, native
from carom.lab.build.wheel import make_wheels

ROOT = Path(__file__).resolve().parents[1]
NOT_UPLOADED = ("wasm32",)  # for pages, beside the game
HEAVIEST = 5_000_000  # bytes of a wheel
# With the wheel, in an empty folder: it steps, compiles nothing, and its command runs.
TRY = """
import carom, sys
from carom import Joints, Physics, RigidBody, Rotation, SphereCollider, Transform, World
from carom.framework.compilation import log
assert carom.__version__ == sys.argv[1], carom.__version__
for dimensions in (2, 3):
    with World(Physics(dimensions, gravity=(0, -10, 0)[:dimensions]), Rotation(), Joints()) as world:
        world.create_entity(Transform((0, 5, 0)[:dimensions]), RigidBody(), SphereCollider(0.5))
        for _ in range(60):
            world.step()
        assert abs(world.bodies.position[0, 1] - (5 - 10 / 2 * 61 / 60)) < 1e-9
assert not log.compiled, log.compiled
assert "numba" not in sys.modules
"""


def git(*arguments: str, root: Path = ROOT) -> str:
    return subprocess.run(["git", *arguments], cwd=root, check=True, capture_output=True, text=True).stdout.rstrip()


def findings(version: str, root: Path = ROOT) -> list[str]:
    """What has to be mended before this version can be released from a checkout; a line each."""
    found = []
    if not re.fullmatch(r"\d+\.\d+\.\d+((a|b|rc)\d+)?", version):
        found.append(f"{version}: a version is three numbers, and perhaps a1, b1 or rc1")
    if changed := git("status", "--porcelain", root=root):
        found.append(f"the checkout is not clean: {', '.join(line[3:] for line in changed.splitlines()[:5])}")
    if f"v{version}" in git("tag", root=root).split():
        found.append(f"there is a tag v{version} already")
    source = (root / "src/carom/__init__.py").read_text(encoding="utf-8")
    own = re.search(r'^__version__ = "(.*)"$', source, re.MULTILINE)
    if own is None or own[1] != version:
        found.append(f"src/carom/__init__.py says {own and own[1]}, not {version}")
    log = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    first, *_ = re.findall(r"^## (.*)\n((?:(?!## ).*\n)*)", log, re.MULTILINE) or [("", "")]
    if not re.fullmatch(rf"{re.escape(version)} \(\d{{4}}-\d\d-\d\d\)", first[0]):
        found.append(f"the first section of CHANGELOG.md is {first[0]!r}, not '{version} (YYYY-MM-DD)'")
    elif not re.search(r"^- ", first[1], re.MULTILINE):
        found.append(f"CHANGELOG.md says nothing about {version}")
    return found


def wheel_findings(wheel: Path, version: str) -> list[str]:
    """What is wrong with the contents of a wheel."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        information = f"carom-{version}.dist-info"
        if f"{information}/METADATA" not in names:
            return [f"{wheel.name}: no {information}"]
        metadata = email.message_from_bytes(archive.read(f"{information}/METADATA"))
    found = [f"{name} is in it" for name in names if not name.startswith(("carom/", f"{information}/"))]
    needed = ("carom/__init__.py", "carom/__init__.pyi", "carom/py.typed", f"{information}/licenses/LICENSE")
    found += [f"{name} is missing" for name in needed if name not in names]
    if sum(name.startswith(f"carom/{NAME}.") for name in names) != 1:
        found.append("it has not one library of kernels")
    found += [f"no {field}" for field in ("Summary", "License-Expression", "Classifier") if not metadata[field]]
    if metadata["Requires-Python"] != ">=3.11" or metadata["Version"] != version:
        found.append(f"it is {metadata['Version']} for Python {metadata['Requires-Python']}")
    if (size := wheel.stat().st_size) > HEAVIEST:
        found.append(f"{size / 1e6:.1f} MB, more than {HEAVIEST / 1e6:.0f}")
    return [f"{wheel.name}: {each}" for each in found]


def sdist_findings(archive: Path) -> list[str]:
    """What is wrong with the contents of an archive of the sources."""
    with tarfile.open(archive) as tar:
        names = {name.partition("/")[2] for name in tar.getnames()}
    needed = ("pyproject.toml", "LICENSE", "CHANGELOG.md", "src/carom/__init__.py", "src/carom/framework/__init__.py")
    found = [f"{name} is missing" for name in (*needed, "tests/conftest.py", "mkdocs.yml") if name not in names]
    found += [f"{name} is in it" for name in sorted(names) if f"/{NAME}." in name]
    return [f"{archive.name}: {each}" for each in found]


def make_sdist(folder: Path) -> Path:
    """Of the last commit, in a copy of it."""
    with tempfile.TemporaryDirectory() as scratch:
        archive = Path(scratch, "commit.tar")
        git("archive", "--output", str(archive), "HEAD")
        with tarfile.open(archive) as tar:
            tar.extractall(Path(scratch, "carom"), filter="tar")
        code = "import sys, setuptools.build_meta as b; print(b.build_sdist(sys.argv[1]))"
        command = [sys.executable, "-c", code, str(folder.resolve())]
        done = subprocess.run(command, cwd=Path(scratch, "carom"), check=True, capture_output=True, text=True)
    return folder / done.stdout.split()[-1]


def trial_findings(python: str, wheel: Path, version: str) -> list[str]:
    """What goes wrong where the wheel is installed, with all that it needs, into an environment of its own."""
    try:
        with tempfile.TemporaryDirectory() as scratch:
            try_wheel(python, wheel, version, Path(scratch))
    except (OSError, subprocess.CalledProcessError) as error:
        return [f"{wheel.name} with {python}: {error}"]
    click.echo(f"{wheel.name}: runs with {python}")
    return []


def try_wheel(python: str, wheel: Path, version: str, folder: Path) -> None:
    own = folder / "venv"
    subprocess.run([python, "-m", "venv", own], check=True)
    inside = next(path for path in (own / "bin" / "python", own / "Scripts" / "python.exe") if path.exists())
    pip = [inside, "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    subprocess.run([*pip, wheel.resolve()], check=True)
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("CAROM_", "NUMBA_", "PYTHON"))}
    kept["CAROM_CACHE_DIR"] = str(folder / "cache")
    for arguments in (("-c", TRY, version), ("-m", "carom", "scenes")):
        subprocess.run([inside, *arguments], cwd=folder, env=kept, check=True, stdout=subprocess.DEVNULL)


@click.command()
@click.argument("version")
@click.option("--dry-run", is_flag=True, help="Build and try everything whatever is in its way; no tag, no upload.")
@click.option("--platform", "names", multiple=True, type=click.Choice([*PLATFORMS]), help="Only these; default: all.")
@click.option("--python", "pythons", multiple=True, help="Try the wheel with these interpreters too.")
@click.option("--upload", is_flag=True, help="Upload with twine, which has to be installed.")
def main(version: str, dry_run: bool, names: Sequence[str], pythons: Sequence[str], upload: bool) -> None:
    """Check, build, look inside, try in a fresh environment, tag, and say what to upload."""
    found = findings(version)
    twine = importlib.util.find_spec("twine") is not None
    if upload and not twine:
        found.append("--upload needs twine")
    if found and not dry_run:
        raise click.ClickException("\n".join(found))
    folder = ROOT / "dist" / version
    for old in folder.glob("*"):
        old.unlink()
    folder.mkdir(parents=True, exist_ok=True)
    made = [make_sdist(folder)]
    make_wheels(folder, names or [*PLATFORMS])
    made += sorted(folder.glob("*.whl"))
    built = made[1].name.split("-")[1]  # in a dry run perhaps another one
    found += [*sdist_findings(made[0]), *(line for wheel in made[1:] for line in wheel_findings(wheel, built))]
    own = native()
    here = next((wheel for wheel in made[1:] if own and own.wheel_tag in wheel.name), None)
    if here is None:
        found.append("no wheel for this machine was built, none is tried")
    else:
        found += [line for python in (sys.executable, *pythons) for line in trial_findings(python, here, built)]
    if twine and subprocess.run([sys.executable, "-m", "twine", "check", "--strict", *made]).returncode:
        found.append("twine check has findings")
    for file in made:
        click.echo(f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.stat().st_size / 1e6:5.2f} MB  {file.name}")
    tags = [PLATFORMS[name].wheel_tag for name in NOT_UPLOADED]
    files = [file for file in made if not any(tag in file.name for tag in tags)]
    click.echo("to upload: twine upload " + " ".join(str(file.relative_to(ROOT)) for file in files))
    if found:
        raise click.ClickException("\n".join(found))
    if dry_run:
        return
    git("tag", "--annotate", f"v{version}", "--message", f"carom {version}")
    if upload:
        subprocess.run([sys.executable, "-m", "twine", "upload", *map(str, files)], check=True)
    click.echo(f"tagged; to publish the tag: git push origin v{version}")


if __name__ == "__main__":
    main()
