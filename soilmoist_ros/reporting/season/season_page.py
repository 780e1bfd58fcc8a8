# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page of a season: maps with a time slider, the course of the mean, and the course at a chosen place."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import __version__
from soilmoist_ros.mapping import FALSE_SHARE, Estimate
from soilmoist_ros.pipeline import EarlierRun, local_time
from soilmoist_ros.reporting.certainty import ILLUSTRATIVE
from soilmoist_ros.reporting.colours import DIFFERENCE, RATE, UNCERTAIN, WATER, hex_ramp
from soilmoist_ros.reporting.page import numbers
from soilmoist_ros.reporting.page.charts.chart import Area, Chart, Dots, Line, limits_of, round_ticks
from soilmoist_ros.reporting.page.frame import render_page
from soilmoist_ros.reporting.page.viewer.layers import PERCENT, STOPS, colour_limits
from soilmoist_ros.reporting.page.viewer.packing import pack, pack_bits, rounded, thinning
from soilmoist_ros.reporting.season.season import Season, SeasonSurvey

Array = NDArray[np.float64]


def write_season_page(path: Path, season: Season) -> Path:
    """Write the page; return ``path``."""
    path.write_text(render_season(season), encoding="utf-8")
    return path


def render_season(season: Season) -> str:
    """The page as HTML, without requests to other files."""
    labels = season.labels
    return render_page(
        "season.html.j2",
        title=season.title,
        version=__version__,
        place=season.field_name,
        when=f"{len(season.surveys)} surveys, {labels[0]} to {labels[-1]}",
        where=f"{season.field_name} · page made {season.created_utc:%Y-%m-%d %H:%M} UTC",
        simulated=season.simulated,
        lead=_lead(season),
        notes=season.notes,
        data=season_data(season),
        chart=mean_chart(season),
        rows=list(_rows(season)),
        moist=season.curve is not None,
        dated=any(survey.run.date for survey in season.surveys),
        false_share=numbers.percent(FALSE_SHARE),
    )


def season_data(season: Season) -> dict[str, Any]:
    """Everything that the page's script draws, as plain JSON values."""
    grid = season.grid
    step = thinning((len(season.surveys), *grid.mask.shape)[-2:])
    shape = grid.mask[::step, ::step].shape
    return {
        "grid": {
            "x0": float(grid.x_m[0]), "y0": float(grid.y_m[0]), "cell": float(grid.cell_m * step),
            "nx": shape[1], "ny": shape[0],
        },
        "edge": [rounded(np.asarray(ring)) for ring in grid.polygons],
        "holes": [rounded(np.asarray(ring)) for ring in grid.holes],
        "labels": season.labels,
        "days": [round(float(day), 3) for day in season.days],
        "layers": list(_layers(season, step)),
    }  # fmt: skip


def _layers(season: Season, step: int) -> Iterator[dict[str, Any]]:
    """The layers; each has a raster for every survey, in one scale of colours."""
    surveys = season.surveys
    if season.curve is not None:
        vwc = np.stack([100 * one.bands.vwc for one in surveys])
        sd = np.stack([100 * one.bands.vwc_sd for one in surveys])
        unit = f"{PERCENT}, {ILLUSTRATIVE}" if season.illustrative else PERCENT
        yield _layer(season, step, "vwc", "Soil moisture", unit, 1, WATER, vwc, colour_limits(vwc, sd), sd=sd)
    rate = np.stack([one.bands.rate for one in surveys])
    rate_sd = np.stack([one.bands.rate_sd for one in surveys])
    limits = colour_limits(rate, rate_sd)
    yield _layer(season, step, "rate", "Neutron rate", "counts/s", 2, RATE, rate, limits, sd=rate_sd)
    moist = season.curve is not None
    nothing = np.full(season.grid.mask.shape, np.nan)
    change = np.stack([_change(one, moist, nothing) for one in surveys])
    if np.isfinite(change).any():
        most = colour_limits(np.abs(change))[1]
        unit, digits = (PERCENT, 1) if moist else ("counts/s", 2)
        name = DIFFERENCE if moist else f"{DIFFERENCE}_r"
        unsure = [
            pack_bits((one.change.significant == 0)[::step, ::step]) if one.change is not None else ""
            for one in surveys
        ]
        yield {
            **_layer(
                season, step, "change", "Change since the survey before", unit, digits, name, change, (-most, most)
            ),
            "hatch": unsure,
        }
    shown, unit, digits = (sd, PERCENT, 1) if moist else (rate_sd, "counts/s", 3)
    yield _layer(season, step, "sd", "Uncertainty", unit, digits, UNCERTAIN, shown, (0.0, colour_limits(shown)[1]))


def _change(survey: SeasonSurvey, moist: bool, nothing: Array) -> Array:
    if survey.change is None:
        return nothing
    return 100 * survey.change.vwc if moist else survey.change.rate


def _layer(
    season: Season, step: int, key: str, title: str, unit: str, digits: int, colour_map: str, stack: Array,
    limits: tuple[float, float], sd: Array | None = None,
) -> dict[str, Any]:  # fmt: skip
    """A layer with a raster of shape (ny, nx) for every survey."""

    def packed(values: Array) -> list[dict[str, Any]]:
        inside = np.where(season.grid.mask, values, np.nan)
        return [pack(one[::step, ::step]) for one in inside]

    low, high = limits
    return {
        "key": key, "title": title, "unit": unit, "digits": digits, "colours": hex_ramp(colour_map, STOPS),
        "from": low, "to": high, "ticks": [value for value, _ in round_ticks(low, high, 5)],
        "maps": packed(stack), "sds": [] if sd is None else packed(sd),
    }  # fmt: skip


def mean_chart(season: Season) -> Chart:
    """The mean of the field over time, with its 95 % interval."""
    moist = season.curve is not None
    factor = 100.0 if moist else 1.0
    means = [_mean(one, moist) for one in season.surveys]
    value = factor * np.array([one.value for one in means])
    low, high = factor * np.array([one.interval95 for one in means]).T
    days, labels = season.days, season.labels
    quantity = "mean moisture [% by volume]" if moist else "mean rate [counts/s]"
    shown = _spaced(days)
    return Chart(
        "mean",
        "Mean of the field",
        f"{quantity} of {len(days)} surveys, from {value[0]:.3g} to {value[-1]:.3g}.",
        [Area(days, low, high), Line(days, value), Dots(days, value, size_px=7.0)],
        limits_of(days),
        limits_of(low, high),
        "survey",
        quantity,
        "The band is the 95 % interval from counting and interpolation; an error of the calibration shifts all "
        "surveys alike. More neutrons mean drier soil.",
        x_ticks=[(float(days[one]), labels[one]) for one in shown],
    )


def _spaced(days: Array) -> list[int]:
    """Surveys whose labels have room: the first, and each that is a sixth of the season after the last one."""
    shown, least = [0], float(np.ptp(days)) / 6
    for number in range(1, len(days)):
        if days[number] - days[shown[-1]] >= max(least, 1e-9):
            shown.append(number)
    return shown


def _mean(survey: SeasonSurvey, moist: bool) -> Estimate:
    return survey.mean_vwc if moist and survey.mean_vwc is not None else survey.mean_rate


def _lead(season: Season) -> str:
    persistence = season.persistence
    fades = (
        f", which falls to a third in {numbers.number(persistence.decay_days, 2)} days"
        if np.isfinite(persistence.decay_days)
        else ""
    )
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
        drier, wetter = change.shares if change else (float("nan"), float("nan"))
        yield {
            "label": label,
            "name": survey.run.survey.name,
            "samples": str(len(survey.run.survey.samples)),
            "end": _end(season, survey.run),
            "mean": _interval(_mean(survey, moist), moist),
            "rate": f"{survey.mean_rate.value:.3f}" if moist else "",
            "change": "–"
            if change is None
            else _interval(change.mean_vwc if moist and change.mean_vwc else change.mean_rate, moist, "+"),
            "wetter": numbers.percent(wetter),
            "drier": numbers.percent(drier),
            "remarks": " ".join(survey.run.remarks),
        }


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


def _interval(estimate: Estimate, moist: bool, sign: str = "") -> str:
    factor, form = (100.0, f"{sign}.1f") if moist else (1.0, f"{sign}.3f")
    low, high = (factor * value for value in estimate.interval95)
    return f"{factor * estimate.value:{form}} ({low:{form}} to {high:{form}})".replace("-", "−")
