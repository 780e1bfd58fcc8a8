# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Names in messages: short lists, and suggestions for misspelt names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

MAX_NAMES = 12
"""Maximum number of names in a message."""


def listing(names: Iterable[str]) -> str:
    """The names, separated by commas; a long list is cut, with the number of names left out."""
    every = list(names)
    shown = ", ".join(every[:MAX_NAMES])
    return f"{shown} and {len(every) - MAX_NAMES} more" if len(every) > MAX_NAMES else shown


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`` (did you mean 'x'?)`` for a similar known word or the only one with this begin, else an empty text."""
    names = list(map(str, known))  # members of enumerations, too, as people write them
    begin = [name for name in names if word and name.startswith(word)]
    close = difflib.get_close_matches(word, names, n=1, cutoff=0.6) or (begin if len(begin) == 1 else [])
    return f" (did you mean {close[0]!r}?)" if close else ""
