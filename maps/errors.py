"""What is wrong with a map: findings, each with its place, and the error that a refused map raises."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

SHOWN = 6  # findings in a message


class RefusedError(ValueError):
    """Something in a map that cannot be; whoever knows the place makes a finding of it."""


class Finding(NamedTuple):
    """One thing that is wrong: in which file, where in it (``"layer 'ground', tile 3"``), and what."""

    file: Path
    place: str
    text: str

    def __str__(self) -> str:
        return f"{self.file}: {self.place}: {self.text}" if self.place else f"{self.file}: {self.text}"


class MapError(ValueError):
    """A map that was refused; ``findings`` has all that was found, the message the first of them, a line each."""

    def __init__(self, findings: list[Finding]) -> None:
        lines = [str(each) for each in findings[:SHOWN]]
        more = len(findings) - len(lines)
        super().__init__("\n".join([*lines, f"and {more} more"] if more else lines))
        self.findings = findings


class Findings:
    """Collects findings; ``with findings.at("layer 'ground'"):`` names the place of those within it."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.found: list[Finding] = []
        self._places: list[str] = []

    @contextmanager
    def at(self, place: str) -> Iterator[None]:
        self._places.append(place)
        try:
            yield
        except RefusedError as error:
            self.add(str(error))
        finally:
            self._places.pop()

    def add(self, text: str) -> None:
        finding = Finding(self.file, ", ".join(self._places), text)
        if finding not in self.found:
            self.found.append(finding)

    def refuse(self) -> None:
        """MapError if anything was found."""
        if self.found:
            raise MapError(self.found)
