# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Headline and key figures of the report in words."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime

from soilmoist_ros.mapping import Bands
from soilmoist_ros.pipeline import FailedRun, MapRun, local_time
from soilmoist_ros.reporting.geometry import field_polygon
from soilmoist_ros.reporting.moisture_steps import at_one_place, moisture_of_all, moisture_series
from soilmoist_ros.reporting.page.numbers import area, duration, length, percent, volume
from soilmoist_ros.reporting.page.statistics import (
    band_statistics,
    calibration_sd,
    is_usable,
    mean_sd,
    resolution_m,
    uncertain_share,
    undefined_share,
    unusable_share,
)
from soilmoist_ros.reporting.page.statistics import mean_moisture as field_moisture

_CHECK_ALL = "Check N0 and whether all tubes were counted."
_UNFIT = (
    "Do not use the soil moisture before N0, the bulk density and the tubes that were counted have been checked; "
    "the map of the count rate holds."
)
_UNCERTAIN = "The map of the rate is not sure enough for a soil moisture yet: more or longer stops would help."
"""Advice for simulated counts, which use the calibration of the simulation."""


@dataclass(frozen=True)
class Fact:
    """One figure of the headline: value, unit and a short explanation."""

    value: str
    unit: str
    meaning: str


def survey_time(run: MapRun | FailedRun) -> str:
    """Date, times and duration of the survey, in words."""
    start, end, seconds = run.survey_start_utc, run.survey_end_utc, run.survey_duration_s
    if seconds is None:
        return "Date unknown: there are no records"
    if start is None or end is None:
        return f"Duration {duration(seconds)}, on a simulated clock" if run.simulated else "Date unknown"
    text = f"{_span(start, end)} UTC"
    zone = run.time_zone if isinstance(run, MapRun) else ""
    if zone:
        here = _span(local_time(start, zone), local_time(end, zone), since=start)
        text += f", local time {here} ({zone})"
    return f"{text} ({duration(seconds)})"


def _span(start: datetime, end: datetime, since: datetime | None = None) -> str:
    """Begin and end, each with its day unless that is known: from another time, or from the begin."""
    first = "" if since is not None and since.date() == start.date() else f"{_day(start)}, "
    last = "" if start.date() == end.date() else f"{_day(end)}, "
    return f"{first}{start:%H:%M} to {last}{end:%H:%M}"


def place(run: MapRun | FailedRun) -> str:
    """Field, site and time of creation of the report."""
    made = run.created.replace("T", " ").replace("Z", " UTC")
    return " · ".join(filter(None, [run.field_name, run.site, f"report made {made}"]))


def _day(when: datetime) -> str:
    return f"{when.day} {when:%B %Y}"


def facts(run: MapRun) -> list[Fact]:
    """The figures of the headline, the most important first."""
    if at_one_place(run):
        return _facts_of_place(run)
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
    mean, low, high = text(_mean(run)), text(mid.p05), text(mid.p95)
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


def _mean(run: MapRun) -> float:
    """Mean moisture of the field [m^3/m^3], the mean rate without a calibration [counts/s]."""
    known = field_moisture(run.soil_map)
    if known is not None:
        return known.value
    return band_statistics(run.soil_map.vwc if run.calibrated else run.soil_map.rate).mean


def _facts_of_place(run: MapRun) -> list[Fact]:
    mean, series = moisture_of_all(run.track, run.soil_map.curve), moisture_series(run.track, run.soil_map.curve)
    counting = _effort_facts(run)[1:2]
    if not run.calibrated:
        return [Fact(f"{mean.rate:.3f} ± {mean.rate_sd:.3f}", "counts/s", "mean corrected count rate"), *counting]
    low, high = volume(series.bands.vwc.min()), volume(series.bands.vwc.max())
    return [
        Fact(volume(float(mean.vwc)), "% vol.", "mean soil water content"),
        Fact(_interval(mean), "% vol.", "90 % interval of the mean"),
        Fact(f"{low} to {high}", "% vol.", f"lowest to highest of {duration(series.step_s)}"),
        *counting,
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
        inside, placed = run.inside
        where = "all inside the field" if inside == placed else f"{inside} of {placed} inside the field"
        found.append(Fact(duration(seconds), "", f"of counting in {len(run.track)} records, {where}"))
        value, unit = length(run.travelled_m)
        found.append(Fact(value, unit, "travelled"))
    return found


def headline(run: MapRun) -> list[str]:
    """The result in plain sentences."""
    if at_one_place(run):
        return _headline_of_place(run)
    soil_map = run.soil_map
    value, unit = area(float(field_polygon(soil_map).area))
    if not run.calibrated:
        return [
            f"{value} {unit} were mapped as a neutron count rate. More neutrons mean drier soil, but without a "
            "calibration the rate cannot be turned into water content.",
            _support(run),
        ]
    wet = band_statistics(soil_map.vwc)
    if undefined_share(soil_map) == 1:
        return [
            f"{value} {unit} were mapped, but the count rate lies below the calibration curve everywhere, so no "
            f"soil moisture could be computed. {_UNCERTAIN if run.simulated else _CHECK_ALL}"
        ]
    if not is_usable(soil_map):
        return [
            f"{value} {unit} were mapped, but on {percent(unusable_share(soil_map))} of the area the soil "
            "moisture is impossible or not defined: the count rate does not fit the calibration. "
            f"{_UNCERTAIN if run.simulated else _UNFIT}"
        ]
    sentences = [
        f"On average, 100 litres of soil hold {volume(_mean(run))} litres of water in the {value} {unit} mapped.",
        f"The driest twentieth of the area is below {volume(wet.p05)} %, the wettest above {volume(wet.p95)} %.",
        _certainty(run),
        _support(run),
    ]
    undefined = undefined_share(soil_map)
    if undefined > 0:
        sentences.append(
            f"On {percent(undefined)} of the area the rate lies below the calibration curve: the map shows "
            "saturated soil there."
        )
    return sentences


def _support(run: MapRun) -> str:
    """What each value is of, and how fine the map is."""
    size_m = resolution_m(run.soil_map, run.footprint_radius_m or 0.0)
    of = "a " if run.support_text.startswith("mean") else "that of "
    return f"Each value is {of}{run.support_text}. Structures below {size_m:.0f} m are not resolved."


def _headline_of_place(run: MapRun) -> list[str]:
    mean, series = moisture_of_all(run.track, run.soil_map.curve), moisture_series(run.track, run.soil_map.curve)
    if not run.calibrated:
        return [
            f"The count rate at this place was {mean.rate:.3f} counts/s on average. More neutrons mean drier "
            "soil, but without a calibration the rate cannot be turned into water content."
        ]
    water = f"{volume(float(mean.vwc))} litres of water (90 % interval {_interval(mean)})"
    low, high = volume(series.bands.vwc.min()), volume(series.bands.vwc.max())
    return [
        f"On average, 100 litres of soil at this place held {water}.",
        f"Over time, in means of {duration(series.step_s)}, they held {low} to {high} litres.",
    ]


def _interval(bands: Bands) -> str:
    return f"{volume(float(bands.vwc_p05))} to {volume(float(bands.vwc_p95))}"


def _certainty(run: MapRun) -> str:
    """The part of the uncertainty that is common to all places, and the part that differs."""
    between = volume(band_statistics(run.soil_map.vwc_sd).p50)
    text = f"Places are typically known to ± {between} % by volume against each other (one standard deviation)"
    common = calibration_sd(run.soil_map)
    if common is None:
        return f"{text}; an error of the calibration, common to all places, is not included."
    return f"{text}, and the calibration may shift all of them together by ± {volume(common)} %."


def datum(run: MapRun) -> str:
    """Position of the origin of the local metres."""
    lat, lon = run.frame.latitude_deg, run.frame.longitude_deg
    north, east = "N" if lat >= 0 else "S", "E" if lon >= 0 else "W"
    return f"Datum (0, 0): {abs(lat):.6f}° {north}, {abs(lon):.6f}° {east} (WGS-84)"
