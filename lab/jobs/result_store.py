"""Results of runs, kept in one SQLite file as they arrive, so that no run has to be repeated."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

from ..cli.usage_errors import Problem, one_line

PATIENCE = 30.0  # s to wait for another process that writes


class Store:
    """The finished runs in one file, by key; several processes may use it. A context manager.

    A record is a mapping that can be written as JSON (with NaN and infinity); it is returned as read from JSON: tuples
    become lists, keys become strings. path None: in memory. Problem for a file that is no store, and where none can be.
    """

    def __init__(self, path: str | os.PathLike[str] | None = None) -> None:
        self.path = None if path is None else Path(path)
        with self._problems():
            if self.path is not None:
                self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = sqlite3.connect(self.path or ":memory:", timeout=PATIENCE, isolation_level=None)
            self._file.execute("create table if not exists runs (key text primary key, record text not null)")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def __len__(self) -> int:
        return self._file.execute("select count(*) from runs").fetchone()[0]

    def __contains__(self, key: str) -> bool:
        return self._file.execute("select 1 from runs where key = ?", (key,)).fetchone() is not None

    def get(self, key: str) -> dict[str, Any] | None:
        """The record of that run; None if the run is not finished."""
        found = self._file.execute("select record from runs where key = ?", (key,)).fetchone()
        return None if found is None else json.loads(found[0])

    def add(self, key: str, record: Mapping[str, Any]) -> None:
        """Keep a record; it is in the file when this returns. Another record of that key is replaced."""
        with self._problems():
            self._file.execute("insert or replace into runs values (?, ?)", (key, json.dumps(record)))

    @contextmanager
    def _problems(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError) as error:
            raise Problem(f"results cannot be kept in {str(self.path)!r}: {one_line(error)}") from error
