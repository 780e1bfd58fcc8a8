# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Notes on the limits of a map."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from soilmoist_ros.pipeline import (
    EARLIEST_STAMP_S,
    MAX_AHEAD_S,
    MapRun,
    Note,
    NoteCode,
    earlier_doubts,
    mean_rate,
    track_xy,
)
from soilmoist_ros.reporting.geometry import distances_m
from soilmoist_ros.reporting.moisture_steps import at_one_place
from soilmoist_ros.reporting.page.numbers import percent, volume
from soilmoist_ros.reporting.page.statistics import (
    beyond_limits_share,
    explained_share,
    implausible_shares,
    undefined_share,
)
from soilmoist_ros.sensing import n0_in_other_time, reason_text, unusual_factors

if TYPE_CHECKING:
    from soilmoist_ros.mapping import SoilMap

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
        *(_on_one_place() if at_one_place(run) else _on_model(run.soil_map)),
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
    if not run.simulated and (doubt := _n0_doubt(soil_map)):
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


def _n0_doubt(soil_map: SoilMap) -> str:
    """Doubt about an N0 that was given per hour, say; empty if the mean rate fits it."""
    curve = soil_map.curve
    return "" if curve is None else n0_in_other_time(mean_rate(soil_map.samples), curve)


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


def _on_one_place() -> Iterator[Note]:
    yield Note(
        NoteCode.ONE_PLACE,
        "All records lie at one place: its value is not a map of the surroundings. The series over time is what "
        "was measured.",
    )


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
