"""Values that people type."""

from __future__ import annotations

import contextlib
from fractions import Fraction
from typing import Any

import numpy as np

WORDS = {"true": True, "false": False, "none": None}
DIGITS = 6


def value_of(text: str) -> Any:
    """A number, of which 1/120 is an exact one, or true, false or none; else the word itself."""
    text = text.strip()
    for kind in (int, float, Fraction):
        with contextlib.suppress(ValueError, ZeroDivisionError):
            number = kind(text)
            return float(number) if kind is Fraction else number
    return WORDS.get(text.lower(), text)


def values_of(text: str) -> Any:
    """The same of one value, or of several with commas between them, as a tuple."""
    words = text.strip().strip("()[]").split(",")
    return value_of(words[0]) if len(words) == 1 else tuple(map(value_of, words))


def text_of(value: Any) -> str:
    """As it is shown, and typed: numbers of few digits, arrays with commas."""
    if isinstance(value, (bool, np.bool_)) or value is None:
        return str(value).lower()
    if isinstance(value, (float, np.floating)):
        return f"{float(value):.{DIGITS}g}"
    if isinstance(value, np.ndarray) and value.ndim == 1 and len(value) <= 4:
        return ", ".join(map(text_of, value.tolist()))
    if isinstance(value, np.ndarray):
        return f"array of {' x '.join(map(str, value.shape))}" if value.ndim else text_of(value.item())
    return str(value)
