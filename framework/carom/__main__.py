"""The ``carom`` command, also as ``python -m carom``. Ctrl-C ends it with one line, while it is being imported too."""

import os
import sys

STOPPED = 130  # exit code after Ctrl-C


def main() -> None:
    """The entry point of the ``carom`` script."""
    try:
        from carom.lab.cli import main as command

        command()
    except KeyboardInterrupt:
        sys.stderr.write("carom: stopped\n")
        sys.stderr.flush()
        os._exit(STOPPED)  # what is only half imported might fail as it ends


if __name__ == "__main__":
    main()
