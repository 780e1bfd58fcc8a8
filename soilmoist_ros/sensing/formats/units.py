# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Conversion from the units of loggers to the units of this package."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Literal

Converter = Callable[[float], float]
Quantity = Literal["pressure", "temperature", "humidity"]

_DURATION = {"s": 1.0, "ms": 0.001, "min": 60.0, "h": 3600.0}
_SCALES: dict[Quantity, dict[str, float]] = {
    "pressure": {"hPa": 1.0, "mb": 1.0, "mbar": 1.0, "Pa": 0.01, "kPa": 10.0, "mmHg": 1.33322, "inHg": 33.8639},
    "temperature": {"degC": 1.0, "degF": 1.0, "K": 1.0},
    "humidity": {"percent": 0.01, "fraction": 1.0},
}
_SPELLINGS = {
    "hpa": "hPa",
    "hectopascal": "hPa",
    "mb": "mb",
    "mbar": "mbar",
    "millibar": "mbar",
    "pa": "Pa",
    "pascal": "Pa",
    "kpa": "kPa",
    "mmhg": "mmHg",
    "torr": "mmHg",
    "inhg": "inHg",
    "c": "degC",
    "degc": "degC",
    "celsius": "degC",
    "degreescelsius": "degC",
    "degcelsius": "degC",
    "f": "degF",
    "degf": "degF",
    "fahrenheit": "degF",
    "k": "K",
    "kelvin": "K",
    "%": "percent",
    "percent": "percent",
    "pct": "percent",
    "%rh": "percent",
    "fraction": "fraction",
    "volt": "V",
    "volts": "V",
    "v": "V",
    "count": "counts",
    "counts": "counts",
    "m": "m",
    "mm": "mm",
    "m/s": "m/s",
    "w/m2": "W/m2",
}
_RATE = re.compile(
    r"cp([smh])(?![a-z])|(?:/|per)_?(s|sec|seconds?|min|minutes?|h|hrs?|hours?|heure)(?![a-z])"
    r"|(?<![a-z])(h|s|min)_?\^?(?:-1|⁻¹)"
)
_RATES = {"s": "counts_per_second", "m": "counts_per_minute", "h": "counts_per_hour"}


def canonical(text: str) -> str:
    """A unit as a format file spells it, such as degC for ``Deg C``; empty if the unit is unknown.

    >>> canonical("Deg C"), canonical("mBar"), canonical("furlong")
    ('degC', 'mbar', '')
    """
    return _SPELLINGS.get(re.sub(r"[\s.°^_]|^[\[(]|[\])]$", "", text.casefold()), "")


def measures(quantity: Quantity, unit: str) -> bool:
    """Whether a unit is one of a quantity."""
    return unit in _SCALES[quantity]


def rate_of(text: str) -> str:
    """Unit of a count rate in the name or the unit of a column, such as counts_per_hour; empty without one.

    >>> rate_of("Neutrons [1/h]"), rate_of("CPM"), rate_of("n_per_sample"), rate_of("counts/15min")
    ('counts_per_hour', 'counts_per_minute', '', '')
    """
    plain = re.sub(r"[\s._]+", "_", text.casefold()).replace("hz", "cps").replace("stunde", "h")
    match = _RATE.search(plain)
    return _RATES[next(filter(None, match.groups()))[0]] if match else ""


def same(one: str, other: str) -> bool:
    """Whether two units are equal, as hPa and mbar are."""
    return {one, other} <= {"hPa", "mb", "mbar"}


def converter(quantity: Quantity, unit: str) -> Converter:
    """Converter of a unit to hPa, degC or a fraction."""
    if unit == "K":
        return lambda value: value - 273.15
    if unit == "degF":
        return lambda value: (value - 32.0) / 1.8
    return _scale(_SCALES[quantity][unit])


def to_seconds(unit: str) -> Converter:
    """Converter of a unit of duration to seconds."""
    return _scale(_DURATION[unit])


def _scale(factor: float) -> Converter:
    if factor == 0.01:
        return lambda value: value / 100.0  # dividing keeps 965.0 hPa exactly 965.0
    return lambda value: value * factor
