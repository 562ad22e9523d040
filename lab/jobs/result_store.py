"""Results of long runs, appended to a file as they arrive, so that no run has to be repeated.

The file holds one line of JSON for each finished run, ``{"key": "...", ...}``, and is only appended to. It uses two
extensions of JSON that Python's ``json`` module reads and writes: the numbers ``NaN`` and ``Infinity``. The file is
internal to carom; exports are made from it.
"""

from __future__ import annotations

import contextlib
import json
import os
import platform
import time
from collections.abc import Mapping
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ..commands.usage_errors import Problem, one_line

BEGINNING = b'{"key": "'  # of each line
SETTLING = 0.05  # s; enough for two processes that find the same abandoned lock at once to detect each other


class Store:
    """The finished runs in one file, by key. A context manager; one process at a time can have the file open.

    A record is a mapping that can be written as JSON; it is returned as read from JSON: tuples become lists, keys
    become strings. NaN and infinity are preserved.
    """

    def __init__(self, path: Path, lock: _Lock, file: FileIO, records: dict[str, dict[str, Any]]) -> None:
        self.path = path
        self._lock = lock
        self._file = file
        self._records = records

    @classmethod
    def open(cls, path: str | os.PathLike[str], resume: bool = False) -> Self:
        """Create a file, or continue an existing one.

        With ``resume`` the records of an existing file are available at once. An incomplete last line, left by a
        process that was killed while writing, is removed. Without ``resume`` a non-empty file is first moved to
        NAME.before, replacing an older one.

        Problem if another process has the file open, if it cannot be read or written, or if it has a line that no store
        can have written.
        """
        path = Path(path)
        try:
            lock = _Lock(path)
            try:
                if not resume and path.is_file() and path.stat().st_size > 0:
                    os.replace(path, path.with_name(f"{path.name}.before"))
                file = FileIO(path, "a+")
                try:
                    records = _read(path, file)
                except BaseException:
                    file.close()
                    raise
            except BaseException:
                lock.release()
                raise
        except OSError as error:
            raise Problem(f"results cannot be kept in {str(path)!r}: {error.strerror or error}") from error
        return cls(path, lock, file, records)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release the file for other processes. Closing twice does nothing."""
        if not self._file.closed:
            self._file.close()
            self._lock.release()

    def __len__(self) -> int:
        return len(self._records)

    def __contains__(self, key: object) -> bool:
        return key in self._records

    def get(self, key: str) -> dict[str, Any] | None:
        """The record of that run, without its key; None if the run is not finished."""
        return self._records.get(key)

    def add(self, key: str, record: Mapping[str, Any]) -> None:
        """Append a record; it is on the disk when this returns.

        ValueError for a key that already exists, a record that has a field "key", and a closed store; TypeError if the
        record cannot be written as JSON. If writing fails (OSError) the file is left as it was before.
        """
        if not isinstance(key, str):
            raise TypeError(f"key must be a string, not {key!r}")
        if key in self._records:
            raise ValueError(f"{self.path.name} has a record of {key!r} already")
        if "key" in record:
            raise ValueError(f"the record of {key!r} must not have a field 'key' of its own")
        line = json.dumps({"key": key, **record}).encode() + b"\n"
        size = self._file.seek(0, os.SEEK_END)
        try:
            rest = memoryview(line)
            while rest:
                rest = rest[self._file.write(rest) :]
            os.fsync(self._file.fileno())
        except BaseException:  # a full disk, Ctrl-C: remove the incomplete line
            self._file.truncate(size)
            raise
        _, self._records[key] = _parsed(line)


def _read(path: Path, file: FileIO) -> dict[str, dict[str, Any]]:
    """All records; removes an incomplete last line from the file."""
    file.seek(0)
    content = file.readall()
    *lines, rest = content.split(b"\n")
    records: dict[str, dict[str, Any]] = {}
    for number, line in enumerate(lines, 1):
        where = f"{path}, line {number}"
        try:
            key, record = _parsed(line)
        except ValueError as error:
            raise Problem(f"{where}: not a record of a run: {one_line(error)}") from error
        if key in records:
            raise Problem(f"{where}: a second record of {key!r}")
        records[key] = record
    if rest:
        if not (rest.startswith(BEGINNING) or BEGINNING.startswith(rest)):
            raise Problem(f"{path}, line {len(lines) + 1}: not a record of a run")
        file.truncate(len(content) - len(rest))
        os.fsync(file.fileno())
    return records


def _parsed(line: bytes) -> tuple[str, dict[str, Any]]:
    """Key and record; ValueError if the line is not a record."""
    record = json.loads(line.decode())
    if not isinstance(record, dict) or not isinstance(record.get("key"), str):
        raise ValueError("it has no key")
    return record.pop("key"), record


class _Lock:
    """NAME.lock beside the file; it holds the owner's process id and machine.

    Locking needs only exclusive creation of a file, which every file system supports.
    """

    def __init__(self, path: Path) -> None:
        self._path = path.with_name(f"{path.name}.lock")
        self._text = f"{os.getpid()} {platform.node()}\n"
        if not self._taken():
            if not self._abandoned():
                raise self._refusal(path)
            self._path.unlink(missing_ok=True)
            if not self._taken():
                raise self._refusal(path)
            time.sleep(SETTLING)  # another process that found the lock abandoned may just have removed ours
            if self._content() != self._text:
                os.close(self._handle)
                raise self._refusal(path)

    def release(self) -> None:
        os.close(self._handle)
        self._path.unlink(missing_ok=True)

    def _taken(self) -> bool:
        try:
            self._handle = os.open(self._path, os.O_CREAT | os.O_EXCL | os.O_WRONLY)
        except FileExistsError:
            return False
        os.write(self._handle, self._text.encode())  # stays open: Windows then refuses to delete the file
        return True

    def _content(self) -> str:
        try:
            return self._path.read_text(encoding="utf-8", errors="replace")
        except FileNotFoundError:
            return ""

    def _abandoned(self) -> bool:
        """True if the process that made the lock has ended. A process on another machine is assumed to run."""
        number, _, machine = self._content().strip().partition(" ")
        if machine != platform.node() or not number.isdecimal() or int(number) < 1:
            return False
        if os.name == "nt":  # on Windows os.kill would interrupt the process
            with contextlib.suppress(PermissionError):
                self._path.unlink(missing_ok=True)
                return True
            return False
        try:
            os.kill(int(number), 0)
        except (ProcessLookupError, OverflowError):
            return True
        except PermissionError:  # the process runs, as another user
            return False
        return False

    def _refusal(self, path: Path) -> Problem:
        number, _, machine = self._content().strip().partition(" ")
        owner = f"process {number} on {machine}" if machine else "another process"
        return Problem(
            f"{str(path)!r} is being written by {owner}; if that has ended, delete {str(self._path)!r} and try again"
        )
