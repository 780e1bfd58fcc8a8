# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The report in words: headline, key figures, and notes on the limits of a map."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from soilmoist_ros.mapping import Bands, SoilMap
from soilmoist_ros.pipeline import (
    EARLIEST_STAMP_S,
    MAX_AHEAD_S,
    FailedRun,
    MapRun,
    Note,
    NoteCode,
    earlier_doubts,
    local_time,
    mean_rate,
    track_xy,
)
from soilmoist_ros.reporting.geometry import distances_m, field_polygon
from soilmoist_ros.reporting.moisture_steps import at_one_place, moisture_of_all, moisture_series
from soilmoist_ros.reporting.page.frame import area, duration, length, percent, volume
from soilmoist_ros.reporting.page.statistics import (
    band_statistics,
    beyond_limits_share,
    calibration_sd,
    explained_share,
    implausible_shares,
    is_usable,
    mean_sd,
    resolution_m,
    uncertain_share,
    undefined_share,
    unusable_share,
)
from soilmoist_ros.reporting.page.statistics import mean_moisture as field_moisture
from soilmoist_ros.sensing import n0_in_other_time, reason_text, unusual_factors

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
        Fact(*area(float(field_polygon(run.soil_map).area)), "mapped area"),
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


# Notes on the limits of a map -----------------------------------------------------------------------------------

FEW_SAMPLES = 10
MIN_EXPLAINED = 0.1
"""Share of the variance that a map explains below which its squared errors are mostly as large as the variance."""
MAX_RATE_ERROR = 0.05
"""Largest error of a tiled map that needs no note, as a share of the standard deviation."""
MAX_FROM_REFERENCE_HPA = 40.0
"""Largest distance of the mean pressure from its reference that needs no note [hPa]: more than any weather."""
FAR_SHARE = 0.1
"""Share of the records beyond the correlation range above which there is a note."""
MIN_COVERAGE = 0.9
"""Share of the field that a covariate covers from which there is no note."""
MIN_UNCLEAR = 0.01
"""Share of the area from which intervals that reach a limit of the soil need a note."""
_ONE_PLACE = Note(
    NoteCode.ONE_PLACE,
    "All records lie at one place: its value is not a map of the surroundings. The series over time is what was "
    "measured.",
)
_TOO_WET = "N0 or the bulk density is probably too high, or not all tubes were counted"
_TOO_DRY = "N0 is probably too low, or lattice and organic water too high"


def notes(run: MapRun) -> list[Note]:
    """The notes of a run and those that follow from its map, in the order of the report."""
    return [
        *run.notes,
        *_on_quarantine(run),
        *_on_place_and_date(run),
        *_on_pressure(run),
        *_on_factors(run),
        *_on_calibration(run),
        *_on_moisture(run),
        *_on_covariates(run),
        *_on_earlier(run),
        *_on_change(run.soil_map),
        *([_ONE_PLACE] if at_one_place(run) else _on_model(run.soil_map)),
    ]


def _on_quarantine(run: MapRun) -> Iterator[Note]:
    """Note on records that the map leaves out."""
    if run.quarantined:
        reasons = Counter(record.quarantine for record in run.quarantined).most_common()
        number, total = len(run.quarantined), len(run.quarantined) + len(run.track)
        yield Note(
            NoteCode.QUARANTINED,
            f"{number} of {total} records are quarantined: "
            f"{', '.join(f'{reason_text(reason)} ({count})' for reason, count in reasons)}. "
            "The map does not use them; records.csv lists them with their reasons.",
        )


def _on_place_and_date(run: MapRun) -> Iterator[Note]:
    """Notes on records outside the field, and on impossible dates."""
    inside, placed = run.inside
    if 2 * inside < placed:
        yield Note(
            NoteCode.OUTSIDE_FIELD,
            f"Only {inside} of {placed} records lie inside the field: check the field file and the positions.",
        )
    range_m = run.soil_map.variogram.practical_range_m
    far = int(np.count_nonzero(distances_m(run.soil_map, track_xy(run.track)) > range_m))
    if far > FAR_SHARE * placed:
        yield Note(
            NoteCode.FAR_RECORDS,
            f"{far} of {placed} records lie further from the field than counts reach ({range_m:.0f} m): they do "
            "not inform the map, but shape its model. Leave the way to the field out of the log.",
        )
    stamps_s = [record.stamp_s for record in run.track if math.isfinite(record.stamp_s)]
    if not run.simulated and stamps_s:
        ahead_s = max(stamps_s) - run.created_utc.timestamp()
        if min(stamps_s) < EARLIEST_STAMP_S or ahead_s > MAX_AHEAD_S:
            first, last = (str(np.datetime64(int(of(stamps_s)), "s"))[:10] for of in (min, max))
            yield Note(
                NoteCode.IMPOSSIBLE_DATE,
                f"The records are dated {first} to {last}, {'in the future' if ahead_s > 0 else 'before 2000'}: "
                "check the clock of the logger and the order of day and month.",
            )


def _on_pressure(run: MapRun) -> Iterator[Note]:
    """Note on a reference pressure that is not one of the place."""
    row = next((row for row in run.corrections if "beta [1/hPa]" in row.parameters), None)
    if row is None:
        return
    reference_hpa = float(row.parameters["P0 [hPa]"])
    above_hpa = math.log(row.mean_factor) / float(row.parameters["beta [1/hPa]"])
    if abs(above_hpa) > MAX_FROM_REFERENCE_HPA:
        yield Note(
            NoteCode.FAR_REFERENCE_PRESSURE,
            f"The air pressure is {abs(above_hpa):.0f} hPa {'above' if above_hpa > 0 else 'below'} the reference "
            f"of {reference_hpa:.0f} hPa on average. This is right only if N0 was calibrated with this reference; "
            "'reference_hpa: auto' in the site file takes the one of the altitude.",
        )


def _on_factors(run: MapRun) -> Iterator[Note]:
    """Notes on factors far from 1."""
    names = {"air humidity": "f_humidity", "incoming neutrons": "f_intensity"}
    factors = {names[row.name]: (row.min_factor, row.max_factor) for row in run.corrections if row.name in names}
    for doubt in unusual_factors(factors):
        yield Note(NoteCode.UNUSUAL_FACTOR, f"{doubt[0].upper()}{doubt[1:]}")


def _on_calibration(run: MapRun) -> Iterator[Note]:
    if run.calibration is not None and run.calibration.illustrative:
        yield Note(
            NoteCode.ILLUSTRATIVE_CALIBRATION,
            "The calibration is illustrative: patterns are real, absolute soil moisture is not.",
        )
    elif run.calibration is not None and not (
        run.simulated or run.calibration.source or run.calibration.n0_sd_cps
    ):
        yield Note(
            NoteCode.UNKNOWN_CALIBRATION,
            "The site file does not say where N0 comes from. If it is not from cores around this probe, write "
            "'illustrative: true' below 'calibration': patterns are real, absolute soil moisture is not.",
        )


def _on_moisture(run: MapRun) -> Iterator[Note]:
    """Notes on moisture that the soil cannot hold, which the map does not show, and its likely cause."""
    soil_map, limits = run.soil_map, run.soil_map.limits
    if limits is None:
        return
    too_wet, negative = implausible_shares(soil_map)
    below, reached = undefined_share(soil_map), beyond_limits_share(soil_map)
    curve = soil_map.curve
    if not run.simulated and curve and (doubt := n0_in_other_time(mean_rate(soil_map.samples), curve)):
        yield Note(NoteCode.OTHER_TIME_OF_N0, f"{doubt}.")
    pores, unsure = volume(limits.saturation), "the map of the rate is not sure enough there"
    if below > 0 and not run.simulated:
        yield Note(
            NoteCode.RATE_BELOW_CURVE,
            f"On {percent(below)} of the area the count rate is too low for any soil moisture, and the map shows "
            "saturated soil: check N0 and whether all tubes were counted.",
        )
    if too_wet > 0:
        yield Note(
            NoteCode.ABOVE_PORE_VOLUME,
            f"On {percent(too_wet)} of the area the rate means more water than the pores of this soil can hold, "
            f"and the map shows {pores} %: {unsure if run.simulated else _TOO_WET}.",
        )
    if negative > 0:
        yield Note(
            NoteCode.NEGATIVE_MOISTURE,
            f"On {percent(negative)} of the area the rate means less than no water, and the map shows 0 %: "
            f"{unsure if run.simulated else _TOO_DRY}.",
        )
    unclear = reached - below - too_wet - negative
    if unclear >= MIN_UNCLEAR and not at_one_place(run):
        yield Note(
            NoteCode.BEYOND_LIMITS,
            f"On {percent(unclear)} of the area the 90 % interval of the moisture reaches a limit of this soil, "
            f"0 or {pores} %: {unsure}; longer or more stops would help.",
        )


def _on_covariates(run: MapRun) -> Iterator[Note]:
    """Note on covariates that much of the field lacks."""
    shares = {} if run.covariates is None else run.covariates.coverage(run.soil_map.grid)
    gaps = [f"{name} ({percent(share)})" for name, share in shares.items() if share < MIN_COVERAGE]
    if gaps:
        yield Note(
            NoteCode.COVARIATE_GAPS,
            f"Some covariates cover a part of the field only: {', '.join(gaps)}. Elsewhere they count as average; "
            "check that their files reach over the field.",
        )


def _on_earlier(run: MapRun) -> Iterator[Note]:
    """Notes on earlier surveys whose date or count rate can hardly be right."""
    rate = mean_rate(run.soil_map.samples)
    for one in run.earlier:
        for doubt in earlier_doubts(one, rate, run.created_utc, run.survey_end_utc):
            yield Note(NoteCode.DOUBTFUL_EARLIER, f"The earlier survey {one.survey.name} {doubt}")


def _on_change(soil_map: SoilMap) -> Iterator[Note]:
    """Note on a mean rate that changed while the survey lasted."""
    change = soil_map.change
    if not change.text:
        return
    jump = change.jump
    if jump is not None and jump.is_certain and jump.change_cps < 0:
        yield Note(
            NoteCode.RAIN_LIKELY,
            f"Rain is likely during the survey{_at(jump.since_s)}: {jump.text}. The map is of the field at "
            "the end; if it rained, visits to some of the first stops after it make the map better.",
        )
        return
    sure = "The field changed during the survey, as by drying"
    what = sure if change.is_seen else "The field may have changed in between"
    yield Note(
        NoteCode.RATE_CHANGED,
        f"{what}: {change.text}. The map is of the field at the end; visits to some of the first stops at the end "
        "make the map better.",
    )


def _at(stamp_s: float) -> str:
    """Time of a stamp, if its clock has a date."""
    return "" if stamp_s < EARLIEST_STAMP_S else f" at about {str(np.datetime64(int(stamp_s), 's'))[11:16]} UTC"


def _on_model(soil_map: SoilMap) -> Iterator[Note]:
    """Notes on a model that the counts hardly support, or that is not computed exactly."""
    count, fit, accuracy = len(soil_map.samples), soil_map.fit, soil_map.accuracy
    if accuracy is not None and accuracy.rate_error > MAX_RATE_ERROR:
        yield Note(
            NoteCode.TILE_ERROR,
            f"The map is made tile by tile and its rate may be off by {100 * accuracy.rate_error:.0f} % "
            "of its standard deviation: use matern32 or exponential, or merge samples in a larger radius.",
        )
    if count < FEW_SAMPLES:
        yield Note(
            NoteCode.FEW_SAMPLES,
            f"With {count} {'places' if count != 1 else 'place'} measured, the uncertainty itself is hardly "
            "known: measure at ten places or more.",
        )
    elif fit is not None and fit.prior_mattered:
        yield Note(
            NoteCode.PRIOR_MATTERED,
            "The counts say little about how similar the soil moisture of neighbouring places is: the variogram "
            "rests mostly on prior assumptions. More places, near and far from each other, would help.",
        )
    explained = explained_share(soil_map)
    if explained < MIN_EXPLAINED:
        yield Note(
            NoteCode.NO_BETTER_THAN_MEAN,
            f"The map is no better than its mean yet: it explains {percent(explained)} of the differences within "
            "the field. Use the mean of the field, and count longer for a map.",
        )
    if fit is not None and not fit.converged:
        yield Note(NoteCode.NOT_CONVERGED, f"The fit of the variogram did not converge: {fit.message}.")
