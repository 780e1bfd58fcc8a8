# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Numbers as text for readers, rounded to significant digits."""

from __future__ import annotations

import math


def number(value: float | None, digits: int = 3) -> str:
    """A number with this many significant digits, without an exponent if possible; a dash if undefined."""
    if value is None or not math.isfinite(value):
        return "–"
    if value != 0 and not 1e-4 <= abs(value) < 1e7:
        return f"{value:.{digits - 1}e}"
    decimals = max(digits - 1 - (math.floor(math.log10(abs(value))) if value else 0), 0)
    return f"{value:,.{decimals}f}".replace(",", "\u202f").replace("-", "−")


def plain(value: object) -> str:
    """A setting or parameter as text: short floats, a dash for nothing."""
    if value is None or value == "":
        return "–"
    if isinstance(value, float):
        return f"{value:.10g}" if math.isfinite(value) else "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value)


def with_sd(value: float, sd: float | None, digits: int = 3) -> str:
    """A number and its standard deviation to the same decimal place."""
    if sd is None or not (math.isfinite(sd) and sd > 0):
        return number(value, digits)
    decimals = max(1 - math.floor(math.log10(sd)), 0)
    return f"{value:.{decimals}f} ± {sd:.{decimals}f}".replace("-", "−")


def percent(share: float | None) -> str:
    """A share [0..1] in whole percent, but never rounded to 0 or 100."""
    if share is None or not math.isfinite(share):
        return "–"
    if 0 < share < 0.01:
        return "< 1 %"
    if 0.99 < share < 1:
        return "> 99 %"
    return f"{100 * share:.0f} %"


def volume(vwc: float | None) -> str:
    """Water content [m^3/m^3] in percent by volume to one decimal, without the unit.

    Near the pole of the calibration curve numbers grow without limit; above 100 % they are meaningless.
    """
    if vwc is None or not math.isfinite(vwc):
        return "–"
    return "> 100" if vwc > 1 else f"{100 * vwc:.1f}".replace("-", "−")


def tidy(text: str) -> str:
    """The text with no-break spaces between a number and its sign."""
    return text.replace(" %", "\u00a0%").replace("± ", "±\u00a0")


def area(area_m2: float) -> tuple[str, str]:
    """An area and its unit: hectares, square kilometres if large."""
    if area_m2 >= 5e6:
        return number(area_m2 / 1e6), "km²"
    return (number(area_m2 / 1e4, 2 if area_m2 < 1e4 else 3), "ha") if area_m2 >= 500 else (number(area_m2), "m²")


def length(metres: float) -> tuple[str, str]:
    """A length and its unit."""
    return (number(metres / 1000), "km") if metres >= 2000 else (f"{metres:.0f}", "m")


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
