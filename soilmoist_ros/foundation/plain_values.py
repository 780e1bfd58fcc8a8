# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Values that JSON has words for, and texts that no spreadsheet computes and no terminal obeys."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path, PurePath, PurePosixPath, PureWindowsPath
from typing import Any

DAY_S = 86_400.0
"""A day [s]."""
HECTARE_M2 = 1e4
_FOLDERS = re.compile(r"(?<![^\s(\"'=])(?:[A-Za-z]:[\\/]|/)(?:[^\\/\s]+[\\/])*")
"""Folders at the begin of an absolute path."""
_SEQUENCE = re.compile(r"(?:\x1b\[|\x9b)[0-?]*[ -/]*[@-~]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)?|\x1b[ -/]*[0-~]?")
"""Control sequences of terminals: colours and moves, titles and links, others."""
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "'", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""Beginnings of formulas, in both widths, and what a spreadsheet removes before them."""


def shown_path(path: PurePath | str) -> str:
    """A path for results that others read: an absolute one without its folders, which are the computer's own.

    >>> shown_path("logs/may.csv"), shown_path("/data/logs/may.csv"), shown_path("C:/logs/may.csv")
    ('logs/may.csv', 'may.csv', 'may.csv')
    """
    for kind in (PurePosixPath, PureWindowsPath):
        if kind(path).is_absolute():
            return kind(path).name
    return str(path)


def shown_text(text: str) -> str:
    """A message for results that others read, without folders of this computer.

    >>> shown_text("/usr/bin/may.csv:21: no fix on /robot/fix, no counts on /counts")
    'may.csv:21: no fix on /robot/fix, no counts on /counts'
    """

    def without(found: re.Match[str]) -> str:
        return "" if found[0] != "/" and Path(found[0]).is_dir() else found[0]

    return _FOLDERS.sub(without, text)


def read_json(text: str | bytes) -> Any:
    """The value of a JSON text, which may come from a stranger.

    :raises ValueError: if it is not valid JSON, or is nested more deeply than Python can read
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def finite_number(value: Any) -> float | None:
    """The value of a JSON text as a number; ``None`` if it is no number, or is not finite.

    >>> finite_number(3), finite_number(10**400), finite_number(float("nan")), finite_number(True)
    (3.0, None, None, None)
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:  # an integer of hundreds of digits
        return None
    return number if math.isfinite(number) else None


def nan_as_text(value: Any) -> Any:
    """The value with NaN and infinity as text, which reads back as a number: JSON has no word for them."""
    if isinstance(value, dict):
        return {key: nan_as_text(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [nan_as_text(item) for item in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def csv_text(value: Any) -> Any:
    """The value as a cell of CSV: a text that a spreadsheet would take for a formula gets an apostrophe in front.

    >>> csv_text("=A1"), csv_text("stop 3"), csv_text(-4.5)
    ("'=A1", 'stop 3', -4.5)
    """
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


def text_of_csv(cell: str) -> str:
    """The text that :func:`csv_text` wrote.

    >>> text_of_csv("'=1"), text_of_csv("stop 3")
    ('=1', 'stop 3')
    """
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(_FORMULA) else cell


def printable(text: str) -> str:
    r"""The text with what cannot be printed as escapes; line feeds and tabs stay, no-break spaces become plain.

    >>> printable("north\x1b]0;title\x07 \u202e5 m\u00b3")
    'north\\x1b]0;title\\x07 \\u202e5 m³'
    >>> printable("1\u202f545 ha")
    '1 545 ha'
    """
    if text.isprintable():
        return text
    text = text.replace("\u202f", " ").replace("\u00a0", " ")
    return "".join(
        one if one.isprintable() or one in "\n\t" else one.encode("unicode_escape").decode() for one in text
    )


def foreign_text(text: str) -> str:
    r"""A text of another program or person as one line, without control sequences and invisible marks.

    To be called where such a text enters, so that terminal, log, page, table and status need not ask.

    >>> foreign_text("north\x1b[31m\r\n5\u00a0m\u202e\u00b3")
    'north 5 m³'
    """
    if text.isprintable():
        return text
    shown = (one if one.isprintable() else " " * one.isspace() for one in _SEQUENCE.sub("", text))
    return " ".join("".join(shown).split())


def number(value: float | None, digits: int = 3) -> str:
    """A number with this many significant digits, without an exponent if possible; a dash if undefined."""
    if value is None or not math.isfinite(value):
        return "–"
    if value != 0 and not 1e-4 <= abs(value) < 1e7:
        return f"{value:.{digits - 1}e}"
    decimals = max(digits - 1 - (math.floor(math.log10(abs(value))) if value else 0), 0)
    return thousands(value, decimals).replace("-", "−")


def thousands(value: float, decimals: int = 0) -> str:
    """A number with narrow no-break spaces between its thousands; :func:`printable` makes them plain ones."""
    return f"{value:,.{decimals}f}".replace(",", "\u202f")


def area(area_m2: float) -> tuple[str, str]:
    """An area and its unit: hectares, square kilometres if very large."""
    size, unit = area_unit(area_m2)
    return number(area_m2 / size, 2 if size == HECTARE_M2 > area_m2 else 3), unit


def area_unit(area_m2: float) -> tuple[float, str]:
    """Size [m^2] and name of the unit in which an area is shown."""
    if area_m2 >= 5e7:
        return 1e6, "km²"
    return (HECTARE_M2, "ha") if area_m2 >= 500 else (1.0, "m²")


def duration(seconds: float) -> str:
    """A duration in words, rounded to a suitable unit."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    if minutes < 60:
        return f"{minutes} min"
    if minutes < 2880:
        return f"{minutes // 60} h {minutes % 60:02d} min"
    return f"{minutes / 1440:.1f} days"
