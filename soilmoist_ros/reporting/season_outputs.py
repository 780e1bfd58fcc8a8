# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The output folder of a season: table, summary, a GeoTIFF for each survey, and its page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import __version__
from soilmoist_ros.mapping import FieldChange, SurveysEstimate
from soilmoist_ros.pipeline import EarlierRun, local_time
from soilmoist_ros.recording import SUMMARY
from soilmoist_ros.reporting.certainty import CALIBRATION_TAG, calibration_state, guess_text
from soilmoist_ros.reporting.colours import DIFFERENCE, RATE, UNCERTAIN, WATER
from soilmoist_ros.reporting.geotiff import BANDS, CHANGES, write_cell_raster
from soilmoist_ros.reporting.output_folder import replaced_together, writable
from soilmoist_ros.reporting.page.charts import Area, Chart, Dots, Line, limits_of
from soilmoist_ros.reporting.page.frame import number, percent, render_page, with_interval
from soilmoist_ros.reporting.page.viewer import (
    PERCENT,
    colour_limits,
    map_data,
    pack,
    pack_bits,
    shown_as,
    thinning,
)
from soilmoist_ros.reporting.season import Season, SeasonSurvey
from soilmoist_ros.reporting.text_files import write_json, write_table

Array = NDArray[np.float64]

NAMES = (SUMMARY, "report.html", "season.csv")


def write_season(folder: Path, season: Season) -> list[Path]:
    """Write ``summary.json``, ``report.html``, ``season.csv``, ``survey_1.tif`` ...: all are replaced, or none.

    :raises InputError: if the folder cannot be written
    """
    maps = [f"survey_{number}.tif" for number in range(1, len(season.surveys) + 1)]
    names, crs = writable((*NAMES, *maps)), season.frame.export_crs()
    with replaced_together(folder, names) as workshop:
        (workshop / "report.html").write_text(render_season(season), encoding="utf-8")
        for name, survey in zip(maps, season.surveys, strict=True):
            of_survey = _bands(season, survey), _tags(season, survey)
            write_cell_raster(workshop / name, season.grid, season.frame, crs, *of_survey)
        table = rows(season)
        write_table(workshop / "season.csv", list(table[0]), (list(row.values()) for row in table))
        write_json(workshop / SUMMARY, summary(season, names))
    return [folder / name for name in names]


def estimate_text(survey: SeasonSurvey) -> str:
    """Mean of a survey with its interval, and the change since the one before, on one line."""
    moist = survey.mean_vwc is not None
    text = f"{with_interval(_mean(survey, moist), moist)} {PERCENT if moist else 'counts/s'}"
    if survey.change is not None:
        text += f", change {with_interval(_mean(survey.change, moist), moist, '+')}"
    return text


def _mean(one: SeasonSurvey | FieldChange, moist: bool) -> SurveysEstimate:
    return one.mean_vwc if moist and one.mean_vwc is not None else one.mean_rate


def summary(season: Season, outputs: Sequence[str]) -> dict[str, Any]:
    """The season in numbers, for programs."""
    persistence = season.persistence
    return {
        "schema": 1, "software": "soilmoist_ros", "version": __version__, "kind": "season", "title": season.title,
        "field": season.field_name, "simulated": season.simulated, "calibration": _calibration(season),
        "time_zone": season.time_zone or None, "created_utc": f"{season.created_utc:%Y-%m-%dT%H:%M:%SZ}",
        "datum": asdict(season.frame), "cell_m": season.grid.cell_m,
        "cells": int(np.count_nonzero(season.grid.mask)),
        "variogram": {
            "model": season.variogram.model, "nugget_cps2": season.variogram.nugget,
            "range_m": season.variogram.range_m, "sill_cps2": season.variogram.sill,
        },
        "pattern_correlation": persistence.share, "pattern_correlation_sd": persistence.sd,
        "pattern_decay_days": persistence.decay_days if math.isfinite(persistence.decay_days) else None,
        "false_discovery_rate": FieldChange.FALSE_SHARE, "warnings": list(season.notes), "surveys": rows(season),
        "outputs": list(outputs),
    }  # fmt: skip


def _utc(run: EarlierRun) -> str:
    return f"{datetime.fromtimestamp(run.survey.stamp_s, UTC):%Y-%m-%dT%H:%M:%SZ}"


def _calibration(season: Season) -> str:
    return calibration_state(season.curve is not None, not season.illustrative, season.simulated, season.method)


def rows(season: Season) -> list[dict[str, Any]]:
    """One row per survey; undefined values are ``None``."""
    found = []
    for label, survey in zip(season.labels, season.surveys, strict=True):
        run, change = survey.run, survey.change
        end = _utc(run) if run.date else None
        drier, wetter = change.shares if change else (None, None)
        found.append({
            "survey": run.survey.name, "label": label, "end_utc": end, "end_stamp_s": run.survey.stamp_s,
            "records": len(run.records), "samples": len(run.survey.samples),
            **_columns("mean_rate_cps", survey.mean_rate), **_columns("mean_vwc", survey.mean_vwc),
            **_columns("change_rate_cps", change.mean_rate if change else None),
            **_columns("change_vwc", change.mean_vwc if change else None),
            "drier_share": drier, "wetter_share": wetter, "remarks": " ".join(run.remarks),
            "calibration": _calibration(season),
        })  # fmt: skip
    return found


def _columns(name: str, estimate: SurveysEstimate | None) -> dict[str, float | None]:
    if estimate is None:
        return dict.fromkeys((name, f"{name}_low95", f"{name}_high95"))
    low, high = estimate.interval95
    return {name: estimate.value, f"{name}_low95": low, f"{name}_high95": high}


def _bands(season: Season, survey: SeasonSurvey) -> dict[str, Array]:
    """Rasters of a survey by the names of GeoTIFFs: moisture, rate, and their change since the survey before."""
    found = {name: np.asarray(getattr(survey.bands, name), float) for name in BANDS}
    if survey.change is not None:
        found |= {name: np.asarray(getattr(survey.change, name.replace("_change", ""))) for name in CHANGES}
    return {name: values for name, values in found.items() if season.curve is not None or name[:3] != "vwc"}


def _tags(season: Season, survey: SeasonSurvey) -> dict[str, str]:
    """Origin of the map of a survey."""
    tags = {
        "SOILMOIST_SURVEY": survey.run.survey.name, "SOILMOIST_SIMULATED": "yes" if season.simulated else "no",
        CALIBRATION_TAG: _calibration(season),
    }  # fmt: skip
    if survey.run.date:
        tags["SOILMOIST_SURVEY_END_UTC"] = _utc(survey.run)
    return tags


# The page of a season: maps with a time slider, the course of the mean, and the course at a chosen place --------


def render_season(season: Season) -> str:
    """The page as HTML, without requests to other files."""
    labels = season.labels
    return render_page(
        "season.html.j2", title=season.title, version=__version__, place=season.field_name,
        when=f"{len(season.surveys)} surveys, {labels[0]} to {labels[-1]}",
        where=f"{season.field_name} · page made {season.created_utc:%Y-%m-%d %H:%M} UTC",
        simulated=season.simulated, lead=_lead(season), notes=season.notes, data=season_data(season),
        chart=mean_chart(season), rows=list(_rows(season)), moist=season.curve is not None,
        dated=any(survey.run.date for survey in season.surveys),
    )  # fmt: skip


def season_data(season: Season) -> dict[str, Any]:
    """Everything that the map viewer draws, as plain JSON values."""
    grid = season.grid
    (west, south), (east, north) = grid.box
    half = grid.cell_m / 2
    edges = west - half, east + half, south - half, north + half
    return map_data(season.frame, edges, [grid], _layers(season), labels=season.labels)


def _layers(season: Season) -> Iterator[dict[str, Any]]:
    """The layers; each has a raster for every survey, in one scale of colours."""
    surveys, mask = season.surveys, season.grid.mask
    step, nothing = thinning(mask.shape), np.full(mask.shape, np.nan)
    every = [_bands(season, one) for one in surveys]

    def stack(name: str) -> Array:
        return np.stack([one.get(name, nothing) for one in every])

    def layer(key: str, values: Array, **more: Any) -> dict[str, Any]:
        rasters = np.where(mask, values, np.nan)[:, ::step, ::step]
        return {"key": key, "grid": 0, "maps": [pack(one) for one in rasters], **more}

    moist, rate, rate_sd = season.curve is not None, stack("rate"), stack("rate_sd")
    vwc_sd = 100 * stack("vwc_sd")
    if moist:
        vwc, unit = 100 * stack("vwc"), PERCENT + guess_text(_calibration(season))
        look = shown_as("Soil moisture", unit, 1, WATER, colour_limits(vwc, vwc_sd))
        yield layer("vwc", vwc, **look, sd="vwc_sd", about="Pale is dry, dark blue is wet.")
    look = shown_as("Neutron rate", "counts/s", 2, RATE, colour_limits(rate, rate_sd))
    yield layer("rate", rate, **look, sd="rate_sd", about="More neutrons mean drier soil.")
    change = 100 * stack("vwc_change") if moist else stack("rate_change")
    if np.isfinite(change).any():
        most = colour_limits(np.abs(change))[1]
        style = (PERCENT, 1, DIFFERENCE) if moist else ("counts/s", 2, f"{DIFFERENCE}_r")
        look = shown_as("Change since the survey before", *style, (-most, most))
        false_share = percent(FieldChange.FALSE_SHARE)
        found = layer("change", change, **look, hatchText="not significant",
                      about="In the change, brown is drier and green wetter. Hatched: the change is not "
                      f"significant (false discovery rate {false_share}).")  # fmt: skip
        for raster, one in zip(found["maps"], surveys, strict=True):
            if one.change is not None:
                raster["hatch"] = pack_bits((one.change.significant == 0)[::step, ::step])
        yield found
    key, sd, unit, digits = ("vwc_sd", vwc_sd, PERCENT, 1) if moist else ("rate_sd", rate_sd, "counts/s", 3)
    look = shown_as("Uncertainty", unit, digits, UNCERTAIN, (0.0, colour_limits(sd)[1]))
    yield layer(key, sd, **look, about="One standard deviation: dark is unsure.")
    if moist:
        yield layer("rate_sd", rate_sd)


def mean_chart(season: Season) -> Chart:
    """The mean of the field over time, with its 95 % interval."""
    moist = season.curve is not None
    factor = 100.0 if moist else 1.0
    means = [_mean(one, moist) for one in season.surveys]
    value = factor * np.array([one.value for one in means])
    low, high = factor * np.array([one.interval95 for one in means]).T
    days, labels = season.days, season.labels
    quantity = "mean moisture [% by volume]" if moist else "mean rate [counts/s]"
    shown = [0]  # labels need room: a sixth of the season
    for one in range(1, len(days)):
        if days[one] - days[shown[-1]] >= max(float(np.ptp(days)) / 6, 1e-9):
            shown.append(one)
    return Chart(
        "mean", "Mean of the field",
        f"{quantity} of {len(days)} surveys, from {value[0]:.3g} to {value[-1]:.3g}.",
        [Area(days, low, high), Line(days, value), Dots(days, value, size_px=7.0)],
        limits_of(days), limits_of(low, high), "survey", quantity,
        "The band is the 95 % interval from counting and interpolation; an error of the calibration shifts all "
        "surveys alike. More neutrons mean drier soil.",
        x_ticks=[(float(days[one]), labels[one]) for one in shown],
    )  # fmt: skip


def _lead(season: Season) -> str:
    persistence, fades = season.persistence, ""
    if np.isfinite(persistence.decay_days):
        fades = f", which falls to a third in {number(persistence.decay_days, 2)} days"
    return (
        "The map of each survey is made from the counts of all of them, earlier and later: what persists in this "
        "field is learned once. The patterns of two surveys have a correlation of "
        f"{persistence.share:.2f} ± {persistence.sd:.2f}{fades}."
    )


def _rows(season: Season) -> Iterator[dict[str, str]]:
    """Rows of the table of surveys."""
    moist = season.curve is not None
    for label, survey in zip(season.labels, season.surveys, strict=True):
        change = survey.change
        drier, wetter = change.shares if change else (None, None)
        yield {
            "label": label, "name": survey.run.survey.name, "samples": str(len(survey.run.survey.samples)),
            "end": _end(season, survey.run), "mean": with_interval(_mean(survey, moist), moist),
            "rate": f"{survey.mean_rate.value:.3f}" if moist else "",
            "change": "–" if change is None else with_interval(_mean(change, moist), moist, "+"),
            "wetter": percent(wetter), "drier": percent(drier), "remarks": " ".join(survey.run.remarks),
        }  # fmt: skip


def _end(season: Season, run: EarlierRun) -> str:
    """End of a survey in UTC and in the time zone of the field, if it is known; empty without a date."""
    if not run.date:
        return ""
    end = datetime.fromtimestamp(run.survey.stamp_s, UTC)
    if not season.time_zone:
        return f"{end:%H:%M} UTC"
    here = local_time(end, season.time_zone)
    day = "" if here.date() == end.date() else f"{here:%Y-%m-%d} "
    return f"{end:%H:%M} UTC, {day}{here:%H:%M} {season.time_zone}"
