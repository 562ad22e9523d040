"""What files and plugins of the user may do to the ``carom`` command: exits, modules beside them; and Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap

import helpers_cli
import pytest
from helpers_cli import FALLING_BALL, refusal, report_of
from helpers_cli_plugins import offer

from carom.framework import Settings
from carom.lab.cli.loading import load

carom = helpers_cli.carom  # a fixture


# -- plugins and Ctrl-C ---------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["import sys\nsys.exit(3)\n", "def plugin():\n    raise SystemExit\n"])
def test_a_plugin_that_exits_is_named(carom, tmp_path, monkeypatch, text):
    name = f"quits_{len(text)}"
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / f"{name}.py").write_text(text)
    offer(tmp_path / "site", "quitpack", {"quitter": f"{name}:plugin"}, monkeypatch)
    listed = carom("plugins")
    assert listed.exit_code == 0
    assert "quitter" in listed.stdout
    assert "SystemExit" in listed.stdout
    assert "SystemExit" in refusal(carom("run", "jump", "--steps", "1", "--no-pictures", "--plugin", "quitter"))


def test_ctrl_c_while_importing_is_one_line():
    code = """
    import runpy, sys

    class Interrupts:
        def find_spec(self, name, path=None, target=None):
            if name == "numpy":
                raise KeyboardInterrupt

    sys.meta_path.insert(0, Interrupts())
    runpy.run_module("carom", run_name="__main__")
    """
    result = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True)
    assert (result.returncode, result.stdout, result.stderr) == (130, "", "carom: stopped\n")


@pytest.mark.slow
def test_ctrl_c_inside_of_code_made_of_a_string_has_its_exit_code(tmp_path):
    """Python notes it there, and would end by the signal."""
    (tmp_path / "scene.py").write_text("def build(settings, seed=0):\n    exec('raise KeyboardInterrupt')\n")
    command = [sys.executable, "-m", "carom", "run", "scene.py", "--no-pictures"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (result.returncode, result.stdout, result.stderr.strip()) == (130, "", "carom: stopped")


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no groups of processes")
def test_ctrl_c_while_compiling_is_one_line(tmp_path):
    """Also of the processes that compile beside the first one."""
    process = subprocess.Popen(
        [sys.executable, "-m", "carom", "run", "jump", "--no-pictures"], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, start_new_session=True,
        env={**os.environ, "CAROM_LIBRARY": "0", "CAROM_CACHE_DIR": str(tmp_path / "cache")},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # ignored in the background of a shell
    )  # fmt: skip
    with process:
        first = process.stderr.readline()
        assert "compiling" in first
        for _ in range(20):  # the compiler swallows one now and then
            try:
                process.wait(1.5)  # by then both are at work
                break
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGINT)
        output = process.communicate(timeout=60)[1]
    assert process.returncode == 130, output
    assert "Traceback" not in output
    assert output.splitlines()[-1] == "carom: stopped"


def test_a_scene_may_be_named_with_hyphens():
    assert load("billiards-spin").name == "billiards_spin"


# -- modules beside a file ------------------------------------------------------------------------

SIBLING = FALLING_BALL.replace("def build", "import params\n\ndef build").replace("(seed, 10)", "(0, params.HEIGHT)")
LATE = FALLING_BALL.replace(
    "    world = World", "    import params\n    from tools.more import twice\n    world = World"
).replace("(seed, 10)", "(0, twice(params.HEIGHT))")


@pytest.mark.parametrize(("text", "factor"), [(SIBLING, 1), (LATE, 2)], ids=["at the top", "inside build"])
def test_files_of_different_folders_have_their_own_siblings(tmp_path, text, factor):
    """``import params`` and packages, in the file and in its functions; nothing of it is left behind."""
    for number in (3, 7):
        folder = tmp_path / str(number)
        (folder / "tools").mkdir(parents=True)
        (folder / "tools" / "__init__.py").write_text("")
        (folder / "tools" / "more.py").write_text("def twice(x):\n    return 2 * x\n")
        (folder / "params.py").write_text(f"HEIGHT = {number}.0\n")
        (folder / "scene.py").write_text(text)
    before = [*sys.path], {name for name in sys.modules if not name.startswith("carom_file_")}
    loaded = [load(str(tmp_path / str(number) / "scene.py")) for number in (3, 7)]
    for number, scene in [*zip((3, 7), loaded, strict=True), (3, loaded[0])]:
        world = scene.build(None, {}, 0)
        assert world.bodies.dynamic.position[0, 1] == factor * number
        world.close()
    left = {name for name in sys.modules if not name.startswith(("carom_file_", "carom."))}
    assert sys.path == before[0]
    assert not {"params", "tools", "tools.more"} & left


# -- settings -------------------------------------------------------------------------------------


def test_a_build_that_ignores_its_settings_gets_them_all_the_same(carom, tmp_path):
    (tmp_path / "deaf.py").write_text(FALLING_BALL.replace("settings=settings or Settings.balanced()", "settings=None"))
    arguments = ("run", "deaf.py", "--steps", "1", "--no-pictures", "--json")
    assert report_of(carom(*arguments, "--set", "dt=1/120"))["settings"]["dt"] == 1 / 120
    fast, settings = report_of(carom(*arguments, "--settings", "fast"))["settings"], Settings.fast()
    assert (fast["substeps"], fast["dt"]) == (settings.substeps, settings.dt)
