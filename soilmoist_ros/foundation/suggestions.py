"""Names in messages: lists that stay short, and a guess at what was meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

MAX_NAMES = 12
"""Names that a message spells out."""


def listing(names: Iterable[str]) -> str:
    """The names, separated by commas; of many only the first ones and how many more there are."""
    every = list(names)
    shown = ", ".join(every[:MAX_NAMES])
    return f"{shown} and {len(every) - MAX_NAMES} more" if len(every) > MAX_NAMES else shown


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`` (did you mean 'x'?)`` for a known word that is close, else nothing."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f" (did you mean {close[0]!r}?)" if close else ""
