"""The progress of a command: on a terminal a bar with the time left, else a line now and then."""

from __future__ import annotations

import io
import re

from rich.console import Console

from carom.lab.reporting.progress import Progress


def test_the_time_left_follows_from_the_rate():
    """After 80 of 1000 in 40 s."""
    now = 0.0
    shown = io.StringIO()
    console = Console(file=shown, force_terminal=True, width=80, get_time=lambda: now)
    with Progress(console) as bar:
        bar.begin(1000)
        for _ in range(4):
            now += 10
            bar.advance(20)
        assert bar.done == 80
        bar.say("runs")
    assert re.findall(r"\d:\d\d:\d\d", shown.getvalue())[-1] == "0:07:40"


def test_what_it_says_is_no_markup():
    shown = io.StringIO()
    with Progress(Console(file=shown, force_terminal=True, width=80)) as bar:
        bar.say("doors [/open] [red]")
    assert "doors [/open] [red]" in shown.getvalue()


def test_without_a_terminal_there_is_a_line_now_and_then(monkeypatch):
    now = 100.0
    monkeypatch.setattr("carom.lab.reporting.progress.time.monotonic", lambda: now)
    shown = io.StringIO()
    with Progress(Console(file=shown)) as bar:
        bar.begin(40)
        for _ in range(40):
            now += 1
            bar.say("runs")
            bar.advance(1)
    lines = shown.getvalue().splitlines()
    assert len(lines) == 8
    assert lines[-1] == "runs: 98 %"
