# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The report in words: key figures, support of the values, and notes on the limits of a map."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from typing import NamedTuple

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
    inside_boundary,
    local_time,
    mean_rate,
    track_xy,
)
from soilmoist_ros.reporting.budget import level_remedy, make_budget, place_remedy
from soilmoist_ros.reporting.certainty import ILLUSTRATIVE, calibration_of
from soilmoist_ros.reporting.geometry import distances_m, field_polygon
from soilmoist_ros.reporting.one_place import at_one_place, moisture_of_all
from soilmoist_ros.reporting.page import statistics
from soilmoist_ros.reporting.page.frame import area, duration, length, percent, volume
from soilmoist_ros.reporting.page.statistics import band_statistics, undefined_share
from soilmoist_ros.sensing import UNKNOWN_SENSOR, n0_in_other_time, reason_text, unusual_factors


class Fact(NamedTuple):
    """A key figure: value, unit and a short explanation."""

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
    if isinstance(run, MapRun) and (zone := run.time_zone):
        text += f", local time {_span(local_time(start, zone), local_time(end, zone), since=start)} ({zone})"
    return f"{text} ({duration(seconds)})"


def _span(start: datetime, end: datetime, since: datetime | None = None) -> str:
    """Begin and end, each with its day unless that is known: from another time, or from the begin."""
    first = "" if since is not None and since.date() == start.date() else f"{start.day} {start:%B %Y}, "
    last = "" if start.date() == end.date() else f"{end.day} {end:%B %Y}, "
    return f"{first}{start:%H:%M} to {last}{end:%H:%M}"


def place(run: MapRun | FailedRun) -> str:
    """Field, site and time of creation of the report."""
    made = run.created.replace("T", " ").replace("Z", " UTC")
    return " · ".join(filter(None, [run.field_name, run.site, f"report made {made}"]))


def facts(run: MapRun) -> list[Fact]:
    """Key figures, the most important first."""
    if at_one_place(run):
        return _facts_of_place(run)
    soil_map, moist = run.soil_map, run.calibrated
    of_field = [Fact(*area(float(field_polygon(soil_map.grid).area)), "mapped area"), *_effort_facts(run)]
    if moist and not statistics.is_usable(soil_map):
        share = percent(statistics.unusable_share(soil_map))
        return [Fact("impossible", "", f"soil water on {share} of the area: N0 does not fit the rate"), *of_field]
    text, unit = (volume, "% vol.") if moist else (_rate, "counts/s")
    spread = band_statistics(soil_map.vwc_sd if moist else soil_map.rate_sd)
    mid = band_statistics(soil_map.vwc if moist else soil_map.rate)
    low, high = text(mid.p05), text(mid.p95)
    limit = f"{volume(statistics.UNCERTAIN_VWC_SD)} {unit}" if moist else percent(statistics.UNCERTAIN_RATE_SHARE)
    unsure = statistics.uncertain_share(soil_map)
    order = "driest to wettest" if moist else "wettest to driest"
    return [
        _fact_of_mean(run),
        Fact(low if low == high else f"{low} to {high}", unit, f"{order} (5 % to 95 % of the area)"),
        Fact(f"± {text(spread.p50)}", unit, "typical uncertainty at one place"),
        Fact(percent(unsure), "", f"of the area less sure than ± {limit}"), *of_field,
    ]  # fmt: skip


def _fact_of_mean(run: MapRun) -> Fact:
    """Mean of the field: the moisture with the 90 % interval that the calibration and the counts leave."""
    soil_map, mean = run.soil_map, _mean(run)
    if not run.calibrated:
        sd = statistics.mean_sd(soil_map, moisture=False)
        value = _rate(mean) if sd is None else f"{_rate(mean)} ± {_rate(sd)}"
        return Fact(value, "counts/s", "mean corrected count rate")
    known = statistics.mean_moisture(soil_map)
    if known is None:
        return Fact(volume(mean), "% vol.", "mean soil water content")
    without = "" if known.common_sd > 0 or run.simulated else ", without that of the calibration"
    if calibration_of(run) == ILLUSTRATIVE:
        without = ", level not known"
    return _fact_of_moisture(statistics.moisture_text(mean, known.p05, known.p95, soil_map.limits), without)


def _fact_of_moisture(texts: tuple[str, str, str], without: str = "") -> Fact:
    value, interval, remark = texts
    about = ", ".join(filter(None, [interval and f"90 % interval{without}", remark]))
    return Fact(f"{value} ({interval})" if interval else value, "% vol.", f"mean soil water content ({about})")


def _mean(run: MapRun) -> float:
    """Mean moisture of the field [m^3/m^3], the mean rate without a calibration [counts/s]."""
    soil_map, known = run.soil_map, statistics.mean_moisture(run.soil_map)
    return known.value if known else band_statistics(soil_map.vwc if run.calibrated else soil_map.rate).mean


def _facts_of_place(run: MapRun) -> list[Fact]:
    mean = moisture_of_all(run.track, run.soil_map.curve)
    counting = _effort_facts(run)[1:2]
    if not run.calibrated:
        return [Fact(f"{mean.rate:.3f} ± {mean.rate_sd:.3f}", "counts/s", "mean corrected count rate"), *counting]
    return [_fact_of_moisture(_of_place(run, mean)), *counting]


def _rate(rate_cps: float | None) -> str:
    return "–" if rate_cps is None or not math.isfinite(rate_cps) else f"{rate_cps:.2f}"


def _effort_facts(run: MapRun) -> list[Fact]:
    samples = run.soil_map.samples
    within = int(np.count_nonzero(inside_boundary(run.soil_map, samples.xy)))
    found = [Fact(str(within), "", "place measured" if within == 1 else "places measured")]
    if outside := len(samples.xy) - within:
        found = [found[0]._replace(meaning=f"{found[0].meaning} in the field, {outside} outside")]
    if run.track:
        seconds = sum(record.exposure_s for record in run.track)
        inside, placed = run.inside
        where = "all inside the field" if inside == placed else f"{inside} of {placed} inside the field"
        found.append(Fact(duration(seconds), "", f"of counting in {len(run.track)} records, {where}"))
        found.append(Fact(*length(run.travelled_m), "travelled"))
    return found


def support(run: MapRun) -> str:
    """Support of each value and resolution of the map, in words."""
    size_m = statistics.resolution_m(run.soil_map, run.footprint_radius_m or 0.0)
    mean = run.support_text.startswith("mean")
    value = f"Each value is a {run.support_text}" if mean else f"The values are of {run.support_text}"
    return f"{value}. Structures below {size_m:.0f} m are not resolved."


def _of_place(run: MapRun, bands: Bands) -> tuple[str, str, str]:
    value, low, high = (float(band) for band in (bands.vwc, bands.vwc_p05, bands.vwc_p95))
    return statistics.moisture_text(value, low, high, run.soil_map.limits)


def datum(run: MapRun) -> str:
    """Position of the origin of the local metres."""
    lat, lon = run.frame.latitude_deg, run.frame.longitude_deg
    north, east = "N" if lat >= 0 else "S", "E" if lon >= 0 else "W"
    return f"Datum (0, 0): {abs(lat):.6f}° {north}, {abs(lon):.6f}° {east} (WGS-84)"


# Notes on the limits of a map -----------------------------------------------------------------------------------

FEW_SAMPLES = 10
MIN_EXPLAINED = 0.1
"""Share of the variance that a map explains below which its squared errors are mostly as large as the variance."""
MAX_FROM_REFERENCE_HPA = 40.0
"""Largest distance of the mean pressure from its reference that needs no note [hPa]: more than any weather."""
FAR_SHARE = 0.1
"""Share of the records beyond the correlation range above which there is a note."""
MIN_COVERAGE = 0.9
"""Share of the field that a covariate covers from which there is no note."""
MIN_UNCLEAR = 0.01
"""Share of the area from which intervals that reach a limit of the soil need a note."""


def notes(run: MapRun) -> list[Note]:
    """The notes of a run and those that follow from its map, in the order of the report."""
    makers = (_on_records, _on_corrections, _on_calibration, _on_moisture, _on_knowledge, _on_model)
    return [*run.notes, *(note for make in makers for note in make(run))]


def _on_records(run: MapRun) -> Iterator[Note]:
    """Notes on records that the map leaves out, that lie outside the field, or have impossible dates."""
    if run.quarantined:
        reasons = Counter(record.quarantine for record in run.quarantined).most_common()
        number, total = len(run.quarantined), len(run.quarantined) + len(run.track)
        yield Note(
            NoteCode.QUARANTINED,
            f"{number} of {total} records are quarantined: "
            f"{', '.join(f'{reason_text(reason)} ({count})' for reason, count in reasons)}. "
            "The map does not use them; records.csv lists them with their reasons.",
        )
    inside, placed = run.inside
    if 2 * inside < placed:
        yield Note(
            NoteCode.OUTSIDE_FIELD,
            f"Only {inside} of {placed} records lie inside the field: check the field file and the positions.",
        )
    range_m = run.soil_map.variogram.practical_range_m
    far = int(np.count_nonzero(distances_m(run.soil_map.grid, track_xy(run.track)) > range_m))
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


def _on_corrections(run: MapRun) -> Iterator[Note]:
    """Notes on a reference pressure that is not one of the place, and on factors far from 1."""
    row = next((row for row in run.corrections if "beta [1/hPa]" in row.parameters), None)
    general = run.calibration is not None and run.calibration.method in ("general", UNKNOWN_SENSOR)
    if row is not None and not general:
        above_hpa = math.log(row.mean_factor) / float(row.parameters["beta [1/hPa]"])
        reference_hpa = float(row.parameters["P0 [hPa]"])
        found_with = run.calibration.reference_hpa if run.calibration is not None else None
        same = found_with is not None and math.isclose(found_with, reference_hpa, abs_tol=0.01)
        if abs(above_hpa) > MAX_FROM_REFERENCE_HPA and not same:
            yield Note(
                NoteCode.FAR_REFERENCE_PRESSURE,
                f"The air pressure is {abs(above_hpa):.0f} hPa {'above' if above_hpa > 0 else 'below'} the "
                f"reference of {reference_hpa:.0f} hPa on average. This is right only if N0 "
                "was calibrated with this reference; 'reference_hpa: auto' in the site file takes the one of "
                "the altitude.",
            )
    names = {"air humidity": "f_humidity", "incoming neutrons": "f_intensity"}
    factors = {names[row.name]: (row.min_factor, row.max_factor) for row in run.corrections if row.name in names}
    for doubt in unusual_factors(factors):
        yield Note(NoteCode.UNUSUAL_FACTOR, f"{doubt[0].upper()}{doubt[1:]}")


def _on_calibration(run: MapRun) -> Iterator[Note]:
    known = run.calibration
    if known is not None and known.method == UNKNOWN_SENSOR:
        source = f"{known.source[0].upper()}{known.source[1:]}"
        text = "No dose follows from it. --sensor MODEL, or sensor_sensitivity in the site file, names the sensor."
        yield Note(NoteCode.UNKNOWN_SENSOR, f"{source}. {text}")
    elif known is not None and known.illustrative:
        yield Note(
            NoteCode.ILLUSTRATIVE_CALIBRATION,
            "The calibration is illustrative: patterns are real, absolute soil moisture is not.",
        )
    elif known is not None and not (run.simulated or known.source or known.n0_sd_cps):
        yield Note(
            NoteCode.UNKNOWN_CALIBRATION,
            "The site file does not say where N0 comes from. If it is not from cores around this probe, write "
            "'illustrative: true' below 'calibration': patterns are real, absolute soil moisture is not.",
        )
    elif known is not None and known.method == "general":
        ranges = [part.name for part in known.parts if part.origin == "default range" and part.name != "snow"]
        text = "No soil core of this field: the level of the moisture is that of the general calibration."
        if ranges:
            text += f" Default ranges, not measured: {', '.join(ranges)}."
        if any(part.name == "snow" for part in known.parts):
            text += " It was near freezing: snow is not accounted for, and would count as soil water."
        yield Note(NoteCode.GENERAL_CALIBRATION, text)
    curve = run.soil_map.curve
    if not run.simulated and curve and (doubt := n0_in_other_time(mean_rate(run.soil_map.samples), curve)):
        yield Note(NoteCode.OTHER_TIME_OF_N0, f"{doubt}.")


def _on_moisture(run: MapRun) -> Iterator[Note]:
    """Notes on moisture that the soil cannot hold, which the map does not show, and its likely cause."""
    soil_map, limits = run.soil_map, run.soil_map.limits
    if limits is None:
        return
    too_wet, negative = statistics.implausible_shares(soil_map)
    below = undefined_share(soil_map)
    unknown = calibration_of(run) == UNKNOWN_SENSOR  # such intervals end there, however long the stops
    unclear = statistics.beyond_limits_share(soil_map) - below - too_wet - negative
    pores, unsure = volume(limits.saturation), "the map of the rate is not sure enough there"
    budget = make_budget(run)
    if budget is not None and budget.level_sd > budget.place_sd:
        reached = f"what is unsure is the level of the whole map; {level_remedy(run)} would help"
    else:
        reached = f"{unsure}; {'longer' if place_remedy(run) == 'count longer' else 'more'} stops would help"
    why_wet = "N0 or the bulk density is probably too high, or not all tubes were counted"
    why_dry = "N0 is probably too low, or lattice and organic water too high"
    for code, share, text in (
        (
            NoteCode.RATE_BELOW_CURVE, below,
            "the count rate is too low for any soil moisture, and the map shows saturated soil: "
            f"{unsure if run.simulated else 'check N0 and whether all tubes were counted'}.",
        ),
        (
            NoteCode.ABOVE_PORE_VOLUME, too_wet,
            "the rate means more water than the pores of this soil can hold, and the map shows "
            f"{pores} %: {unsure if run.simulated else why_wet}.",
        ),
        (
            NoteCode.NEGATIVE_MOISTURE, negative,
            "the rate means less than no water, and the map shows 0 %: "
            f"{unsure if run.simulated else why_dry}.",
        ),
        (
            NoteCode.BEYOND_LIMITS,
            0.0 if unclear < MIN_UNCLEAR or at_one_place(run) or unknown else unclear,
            f"the 90 % interval of the moisture reaches a limit of this soil, 0 or {pores} %: {reached}.",
        ),
    ):  # fmt: skip
        if share > 0:
            yield Note(code, f"On {percent(share)} of the area {text}")


def _on_knowledge(run: MapRun) -> Iterator[Note]:
    """Notes on covariates that much of the field lacks, on shallow roots, and on doubtful earlier surveys."""
    shares = {} if run.covariates is None else run.covariates.coverage(run.soil_map.grid)
    gaps = [f"{name} ({percent(share)})" for name, share in shares.items() if share < MIN_COVERAGE]
    if gaps:
        yield Note(
            NoteCode.COVARIATE_GAPS,
            f"Some covariates cover a part of the field only: {', '.join(gaps)}. Elsewhere they count as average; "
            "check that their files reach over the field.",
        )
    if doubt := run.irrigation.doubt:
        yield Note(NoteCode.SHALLOW_ROOTS, f"{doubt[0].upper()}{doubt[1:]}.")
    rate = mean_rate(run.soil_map.samples)
    for one in run.earlier:
        for doubt in earlier_doubts(one, rate, run.created_utc, run.survey_end_utc):
            yield Note(NoteCode.DOUBTFUL_EARLIER, f"The earlier survey {one.survey.name} {doubt}")


def _on_model(run: MapRun) -> Iterator[Note]:
    """Notes on a mean rate that changed, and on a model that the counts hardly support or that is not exact."""
    soil_map = run.soil_map
    count, fit = len(soil_map.samples), soil_map.fit
    if soil_map.change.text:
        yield _on_change(soil_map)
    if at_one_place(run):
        yield Note(
            NoteCode.ONE_PLACE,
            "All records lie at one place: the value is their mean over the whole time, and no map of the "
            "surroundings. With soilmoist map, --from and --to choose a part of a log.",
        )
        return
    if run.blurred:
        yield Note(NoteCode.WIDE_FOOTPRINT, run.blurred)
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
    explained = statistics.explained_share(soil_map)
    if explained < MIN_EXPLAINED:
        yield Note(
            NoteCode.NO_BETTER_THAN_MEAN,
            f"The map is no better than its mean yet: it explains {percent(explained)} of the differences within "
            "the field. Use the mean of the field, and count longer for a map.",
        )
    if fit is not None and not fit.converged:
        yield Note(NoteCode.NOT_CONVERGED, "The fit of the variogram did not converge.")


def _on_change(soil_map: SoilMap) -> Note:
    """Note on a mean rate that changed while the survey lasted."""
    change, jump = soil_map.change, soil_map.change.jump
    if jump is not None and jump.is_certain and jump.change_cps < 0:
        dated = jump.since_s >= EARLIEST_STAMP_S
        at = f" at about {str(np.datetime64(int(jump.since_s), 's'))[11:16]} UTC" if dated else ""
        return Note(
            NoteCode.RAIN_LIKELY,
            f"Rain is likely during the survey{at}: {jump.text}. The map is of the field at "
            "the end; if it rained, visits to some of the first stops after it make the map better.",
        )
    sure = "The field changed during the survey, as by drying"
    what = sure if change.is_seen else "The field may have changed in between"
    return Note(
        NoteCode.RATE_CHANGED,
        f"{what}: {change.text}. The map is of the field at the end; visits to some of the first stops at the end "
        "make the map better.",
    )
