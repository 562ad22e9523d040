"""The ``carom`` command, also as ``python -m carom``. Ctrl-C ends it with one line, while it is being imported too."""

import os
import sys
from typing import NoReturn

STOPPED = 130  # exit code after Ctrl-C


def stop() -> NoReturn:
    sys.stderr.write("carom: stopped\n")
    sys.stderr.flush()
    os._exit(STOPPED)  # what is only half imported might fail as it ends


def stop_or_tell(unraisable: "sys.UnraisableHookArgs") -> None:
    """Ctrl-C while an object is deleted, where Python only prints it and goes on, ends the command as everywhere."""
    if issubclass(unraisable.exc_type, KeyboardInterrupt):
        stop()
    sys.__unraisablehook__(unraisable)


def main() -> None:
    """The entry point of the ``carom`` script."""
    sys.unraisablehook = stop_or_tell
    try:
        from carom.lab.cli.main import main as command

        command()
    except KeyboardInterrupt:
        stop()


if __name__ == "__main__":
    main()
