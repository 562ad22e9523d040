"""Runs that measure: what goes wrong in them stands in their results, and is not warned of as well."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from ...framework import PhysicsWarning


@contextmanager
def faults_in_results() -> Iterator[None]:
    """No warnings of faults meanwhile; a decorator, too."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PhysicsWarning)
        yield
