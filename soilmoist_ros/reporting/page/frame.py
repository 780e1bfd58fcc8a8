# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Templates, the frame of every page (one self-contained HTML file), and numbers and units for readers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

from soilmoist_ros.exploration import DWELL_RULES, STRATEGIES
from soilmoist_ros.foundation import HECTARE_M2, InputError, area_unit
from soilmoist_ros.foundation import area as area
from soilmoist_ros.foundation import duration as duration
from soilmoist_ros.foundation import number as number
from soilmoist_ros.foundation import thousands as thousands

if TYPE_CHECKING:
    from jinja2 import Environment

    from soilmoist_ros.mapping import SurveysEstimate


def render_page(template: str, **content: Any) -> str:
    """A template filled with content, which is escaped; ``frame.html.j2`` says what every page needs."""
    return _environment().get_template(template).render(**content)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        loader=FunctionLoader(_text),
    )  # fmt: skip
    environment.filters |= {one.__name__: one for one in (number, percent, plain, tidy, with_sd)}
    environment.globals["asset"] = lambda name: Markup(_text(name))
    return environment


def _text(name: str) -> str:
    """A file of the package's templates."""
    return resources.files("soilmoist_ros.reporting.page").joinpath("templates", name).read_text(encoding="utf-8")


# Numbers, units and names of choices for readers ----------------------------------------------------------------


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


def with_interval(one: SurveysEstimate, moist: bool, sign: str = "") -> str:
    """A mean and its 95 % interval: of the moisture [% by volume], or of the rate [counts/s], without the unit."""
    factor, form = (100.0, f"{sign}.1f") if moist else (1.0, f"{sign}.3f")
    low, high = (factor * value for value in one.interval95)
    return f"{factor * one.value:{form}} ({low:{form}} to {high:{form}})".replace("-", "−")


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


def round_step(least: float) -> float:
    """The smallest 1, 2 or 5 times a power of ten that is not below ``least`` (> 0)."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= least * (1 - 1e-9))


def part_of_area(part_m2: float, whole_m2: float) -> str:
    """A part of an area in the unit and with the decimals of the whole, so that the parts of a table compare.

    >>> part_of_area(1_200, 80_000), part_of_area(12, 80_000), part_of_area(0, 80_000)
    ('0.12 ha', '< 0.01 ha', '0 ha')
    """
    size, unit = area_unit(whole_m2)
    digits = 1 if size == HECTARE_M2 > whole_m2 else 2
    decimals = max(digits - math.floor(math.log10(max(whole_m2, 1e-9) / size)), 0)
    if 0 < part_m2 < 0.5 * size * 10**-decimals:
        return f"< {10**-decimals:.{decimals}f} {unit}"
    return f"{thousands(part_m2 / size, decimals)} {unit}" if part_m2 > 0 else f"0 {unit}"


def ranges(limits: Sequence[str], unit: str) -> list[str]:
    """Ranges between rising limits, in words: below the first one, between two, above the last one."""
    between = [f"{low} to {high} {unit}" for low, high in itertools.pairwise(limits)]
    return [f"below {limits[0]} {unit}", *between, f"above {limits[-1]} {unit}"]


def length(metres: float) -> tuple[str, str]:
    """A length and its unit."""
    return (number(metres / 1000), "km") if metres >= 2000 else (f"{metres:.0f}", "m")


def strategy_text(strategy: str) -> str:
    """Name of a strategy for readers."""
    try:
        label = STRATEGIES.get(strategy).label
    except InputError:  # the package that added it is not installed
        label = ""
    return label or strategy.replace("_", " ")


def dwell_text(dwell: str) -> str:
    """Name of a dwell rule for readers: FMI with its seconds, AMI with its standard error in percent."""
    name, _, value = dwell.partition(":")
    try:
        return DWELL_RULES.get(name).describe(value)
    except InputError:
        return dwell.capitalize()
