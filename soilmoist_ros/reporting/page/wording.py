"""Numbers and sentences of the report, with as many digits as are meant."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from soilmoist_ros.reporting.geometry import field_polygon
from soilmoist_ros.reporting.page.statistics import (
    band_statistics,
    calibration_sd,
    implausible_shares,
    mean_sd,
    pore_volume,
    uncertain_share,
    undefined_share,
)
from soilmoist_ros.reporting.run import MapRun

FEW_SAMPLES = 10
MAX_UNUSABLE = 0.25
"""Share of the area with impossible or undefined moisture beyond which no average of it is told."""
_CHECK = "check N0, the bulk density, and whether all tubes were counted"
_CHECK_ALL = "Check N0 and whether all tubes were counted."
_UNFIT = (
    "Do not use the soil moisture before N0, the bulk density and the tubes that were counted have been checked; "
    "the map of the count rate holds."
)
_UNCERTAIN = "The map of the rate is not sure enough for a soil moisture yet: more or longer stops would help."
"""The same where counts are simulated and the calibration is the one they were simulated with."""


@dataclass(frozen=True)
class Fact:
    """One figure of the headline: its value, its unit, and what it means in a few words."""

    value: str
    unit: str
    meaning: str


def number(value: float | None, digits: int = 3) -> str:
    """A number with so many significant digits, no exponent where avoidable; a dash if undefined."""
    if value is None or not math.isfinite(value):
        return "–"
    if value != 0 and not 1e-4 <= abs(value) < 1e7:
        return f"{value:.{digits - 1}e}"
    decimals = max(digits - 1 - (math.floor(math.log10(abs(value))) if value else 0), 0)
    return f"{value:,.{decimals}f}".replace(",", "\u202f").replace("-", "−")


def plain(value: object) -> str:
    """A setting or parameter as a reader writes it: floats without a tail of digits, a dash for nothing."""
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
    """A share [0..1] in percent: whole, but never a false 0 or 100."""
    if share is None or not math.isfinite(share):
        return "–"
    if 0 < share < 0.01:
        return "< 1 %"
    if 0.99 < share < 1:
        return "> 99 %"
    return f"{100 * share:.0f} %"


def volume(vwc: float | None) -> str:
    """Water content [m^3/m^3] in percent by volume to one decimal, without the unit.

    Near the pole of the calibration curve numbers grow without limit; above 100 % they mean nothing more.
    """
    if vwc is None or not math.isfinite(vwc):
        return "–"
    return "> 100" if vwc > 1 else f"{100 * vwc:.1f}".replace("-", "−")


def tidy(text: str) -> str:
    """The same text with spaces that do not break between a number and its sign."""
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
    """A duration in words, to the unit that matters."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    if minutes < 60:
        return f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60:02d} min" if minutes < 6000 else f"{minutes / 60:.0f} h"


def facts(run: MapRun) -> list[Fact]:
    """The figures of the headline, most wanted first."""
    soil_map = run.soil_map
    share = percent(uncertain_share(soil_map, run.uncertain_vwc_sd, run.uncertain_rate_share))
    text: Callable[[float | None], str]
    if run.calibrated:
        mid, spread, unit = band_statistics(soil_map.vwc), band_statistics(soil_map.vwc_sd), "% vol."
        sd, text, names = mean_sd(soil_map, moisture=True), volume, ("soil water content", "driest to wettest")
        limit = f"± {volume(run.uncertain_vwc_sd)} {unit}"
    else:
        mid, spread, unit = band_statistics(soil_map.rate), band_statistics(soil_map.rate_sd), "counts/s"
        sd, text, names = mean_sd(soil_map, moisture=False), _rate, ("corrected count rate", "wettest to driest")
        limit = f"± {percent(run.uncertain_rate_share)}"
    mean, low, high = text(mid.mean), text(mid.p05), text(mid.p95)
    if sd is not None and not mean.startswith(">"):
        mean += f" ± {text(sd)}"
    return [
        Fact(mean, unit, f"mean {names[0]}"),
        Fact(low if low == high else f"{low} to {high}", unit, f"{names[1]} (5 % to 95 % of the area)"),
        Fact(f"± {text(spread.p50)}", unit, "typical uncertainty at one place"),
        Fact(share, "", f"of the area less sure than {limit}"),
        _area_fact(run),
        *_effort_facts(run),
    ]


def _rate(rate_cps: float | None) -> str:
    return "–" if rate_cps is None or not math.isfinite(rate_cps) else f"{rate_cps:.2f}"


def _area_fact(run: MapRun) -> Fact:
    value, unit = area(float(field_polygon(run.soil_map).area))
    return Fact(value, unit, "mapped area")


def _effort_facts(run: MapRun) -> list[Fact]:
    samples = run.soil_map.samples
    found = [Fact(str(len(samples.xy)), "", "places measured" if len(samples.xy) != 1 else "place measured")]
    if run.track:
        seconds = sum(record.exposure_s for record in run.track)
        found.append(Fact(duration(seconds), "", f"of counting in {len(run.track)} records"))
        value, unit = length(run.travelled_m)
        found.append(Fact(value, unit, "travelled"))
    return found


def headline(run: MapRun) -> list[str]:
    """The result in plain sentences."""
    soil_map = run.soil_map
    value, unit = area(float(field_polygon(soil_map).area))
    if not run.calibrated:
        return [
            f"{value} {unit} were mapped as a neutron count rate. More neutrons mean drier soil, but without a "
            "calibration the rate cannot be turned into water content."
        ]
    wet = band_statistics(soil_map.vwc)
    if not math.isfinite(wet.mean):
        return [
            f"{value} {unit} were mapped, but the count rate lies below the calibration curve everywhere, so no "
            f"soil moisture could be computed. {_UNCERTAIN if run.simulated else _CHECK_ALL}"
        ]
    unusable = undefined_share(soil_map) + sum(implausible_shares(soil_map))
    if unusable > MAX_UNUSABLE:
        return [
            f"{value} {unit} were mapped, but on {percent(unusable)} of the area the soil moisture is impossible "
            "or not defined: the count rate does not fit the calibration. "
            f"{_UNCERTAIN if run.simulated else _UNFIT}"
        ]
    sentences = [
        f"On average, 100 litres of soil hold {volume(wet.mean)} litres of water in the {value} {unit} mapped.",
        f"The driest twentieth of the area is below {volume(wet.p05)} %, the wettest above {volume(wet.p95)} %.",
        _certainty(run),
    ]
    undefined = undefined_share(soil_map)
    if undefined > 0:
        sentences.append(
            f"On {percent(undefined)} of the area the rate lies below the calibration curve: the soil moisture is "
            "not defined there (grey on the map)."
        )
    return sentences


def _certainty(run: MapRun) -> str:
    typical = band_statistics(run.soil_map.vwc_sd).p50
    text = (
        f"At a single place the map is typically known to ± {volume(typical)} % by volume (one standard deviation)"
    )
    n0_sd = run.calibration.n0_sd_cps if run.calibration else None
    shift = calibration_sd(run.soil_map, n0_sd)
    if shift is None:
        return f"{text}, an error of the calibration not included."
    return f"{text}; the calibration may shift the whole map by another ± {volume(shift)} %."


def doubts(run: MapRun) -> list[str]:
    """What a careful reader would ask back about: values that no soil has, a model the data hardly support."""
    soil_map, asked = run.soil_map, []
    if soil_map.curve is not None:
        pores = pore_volume(soil_map.curve.bulk_density_gcm3)
        too_wet, negative = implausible_shares(soil_map)
        cause = "the map of the rate is not sure enough there" if run.simulated else _CHECK
        if too_wet > 0:
            asked.append(
                f"On {percent(too_wet)} of the area the soil moisture is above {volume(pores)} %, more than the "
                f"pores of this soil can hold: {cause}."
            )
        if negative > 0:
            asked.append(f"On {percent(negative)} of the area the soil moisture is below zero: {cause}.")
    if len(soil_map.samples) < FEW_SAMPLES:
        asked.append(
            f"With {len(soil_map.samples)} {'places' if len(soil_map.samples) != 1 else 'place'} measured, the "
            "uncertainty itself is hardly known: measure at ten places or more."
        )
    elif soil_map.fit is not None and soil_map.fit.prior_mattered:
        asked.append(
            "The counts say little about how far the soil moisture hangs together in space: the variogram rests "
            "mostly on prior assumptions. More places, near and far from each other, would help."
        )
    if soil_map.fit is not None and not soil_map.fit.converged:
        asked.append(f"The fit of the variogram did not converge: {soil_map.fit.message}.")
    return asked
