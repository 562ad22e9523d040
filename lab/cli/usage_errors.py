"""Errors of the command line: one clear line, with the probable intention, and exit code 2."""

from __future__ import annotations

from collections.abc import Iterable

import click

LONGEST = 400  # characters of an error message


class Problem(click.ClickException):
    """An error that the user can fix; the command line prints it as one line and exits with code 2."""

    exit_code = 2


def did_you_mean(wrong: str, known: Iterable[str]) -> str:
    """`; did you mean 'gas2d'?` for a near miss, else the known names (as many as fit in a line)."""
    from ...framework.names import near_names  # only here: the command's help needs nothing of the framework

    names = list(known)
    near = near_names(wrong, names, count=3, cutoff=0.55)
    if near:
        return f"; did you mean {' or '.join(map(repr, near))}?"
    return f"; there are: {', '.join(names)}" if names else ""


def one_line(error: BaseException) -> str:
    """The error's message in one line, with its type if the message alone is unclear."""
    from ...framework import CaromError  # only here, for the same reason

    text = " ".join(str(error).split())
    text = text if len(text) <= LONGEST else f"{text[:LONGEST]} ... (--traceback shows all of it)"
    if isinstance(error, KeyError) and len(error.args) == 1 and isinstance(error.args[0], str):
        text = " ".join(error.args[0].split())
    if isinstance(error, (ValueError, CaromError, Problem)) and text:
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
