# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""All surveys of a field as a time series; the map of each is made from the counts of all, past and future."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import DAY_S, InputError, LocalFrame
from soilmoist_ros.mapping import (
    Bands,
    FieldChange,
    FieldGrid,
    FieldMapSettings,
    JointKriging,
    ModelName,
    Persistence,
    Samples,
    SurveysEstimate,
    Variogram,
    estimate_variogram,
    field_change,
    load_field,
    make_bands,
    mean_places,
    moisture_slope,
)
from soilmoist_ros.pipeline import (
    EarlierRun,
    EarlierTarget,
    calibration_method,
    curve_of,
    date_text,
    earlier_doubts,
    find_runs,
    is_illustrative,
    mean_rate,
    read_earlier_runs,
    read_summary,
)
from soilmoist_ros.recording import SUMMARY
from soilmoist_ros.reporting.exports.source import field_shapes
from soilmoist_ros.reporting.opened_run import open_run
from soilmoist_ros.sensing import MoistureCurve, load_site

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

MAX_SAMPLES = 4000
"""Number of samples from which each survey is mapped with those nearest to it in time."""
MAX_FITTED = 800
"""Maximum number of samples to which the variogram is fitted: samples of the last surveys."""
MAX_CELLS = 100_000
"""Cells that a map of a season can have: all maps are in one page."""
USUAL_CELLS = 2000
"""Cells that a map has at most, unless a cell size is given."""


@dataclass(frozen=True)
class SeasonSettings:
    """Choices of a season; ``None`` derives the value from the runs.

    :param field: field file; by default the boundary of the last run
    :param site: site file; by default the calibration of the last run
    :param cell_m: cell size of the maps [m]
    """

    field: Path | None = None
    site: Path | None = None
    model: ModelName = "matern32"
    cell_m: float | None = None
    title: str | None = None


class SeasonSurvey(NamedTuple):
    """A survey of the season, mapped with the counts of all.

    :param bands: its maps, each of shape (ny, nx)
    :param mean_rate: mean of the field [counts/s]; ``mean_vwc`` [m^3/m^3] is ``None`` without a calibration
    :param change: change since the survey before it, ``None`` for the first
    """

    run: EarlierRun
    bands: Bands
    mean_rate: SurveysEstimate
    mean_vwc: SurveysEstimate | None
    change: FieldChange | None


@dataclass(frozen=True, eq=False)
class SeasonField:
    """Field of a season, and how its counts become moisture.

    :param property_name: name of the first property of the runs
    :param illustrative: whether the calibration is a guess
    :param time_zone: name of the time zone of the field; empty if it is not known
    :param method: method of the calibration: ``cores``, ``general`` or ``combined``
    """

    field_name: str
    frame: LocalFrame
    grid: FieldGrid
    curve: MoistureCurve | None
    property_name: str
    simulated: bool
    illustrative: bool
    time_zone: str
    method: str


@dataclass(frozen=True, eq=False)
class Season(SeasonField):
    """The surveys of a field over time.

    :param surveys: in order of time, at least two
    :param variogram: variogram of the rate of each survey
    :param persistence: how alike the patterns of the surveys are
    :param notes: what the user should know, in sentences
    """

    title: str
    surveys: Sequence[SeasonSurvey]
    variogram: Variogram
    persistence: Persistence
    created_utc: datetime
    notes: tuple[str, ...] = ()

    @property
    def labels(self) -> list[str]:
        """Day of each survey; days since the first one where the clock has no date."""
        first_s = self.surveys[0].run.survey.stamp_s
        return [
            date_text(one.run.survey.stamp_s) or f"day {(one.run.survey.stamp_s - first_s) / DAY_S:.3g}"
            for one in self.surveys
        ]

    @property
    def days(self) -> Array:
        """Time of each survey since the first one [d]."""
        stamps = np.array([one.run.survey.stamp_s for one in self.surveys])
        return np.asarray((stamps - stamps[0]) / DAY_S, float)


def make_season(
    paths: Sequence[Path], settings: SeasonSettings, progress: Progress = lambda step, share: None
) -> Season:
    """The season of a field.

    :param paths: finished runs, or folders of such
    :raises InputError: if a run cannot be used, or there are fewer than two
    """
    runs_at = [run for path in paths for run in find_runs(path)]
    if len(runs_at) < 2:
        message = f"a season needs two surveys, but there {'is one' if runs_at else 'is none'}"
        raise InputError(message, "give the folders of more runs of this field")
    progress("reading the runs", 0.0)
    place = _ground(runs_at, settings)
    choices = FieldMapSettings(settings.model, curve=place.curve)
    target = EarlierTarget(place.frame, place.grid, choices, place.property_name, simulated=place.simulated)
    runs = read_earlier_runs(runs_at, target)
    progress("fitting the variogram", 0.0)
    variogram = _variogram(runs, settings.model, place.grid)
    samples, stamps = [run.survey.samples for run in runs], [run.survey.stamp_s for run in runs]
    persistence = Persistence.estimate(variogram, samples, stamps)
    surveys, now = list[SeasonSurvey](), datetime.now(UTC)
    kriging, used = None, list[int]()
    for number, run in enumerate(runs):
        progress(f"mapping {len(runs)} surveys", number / len(runs))
        wanted = _window(samples, stamps, number)
        if kriging is None or wanted != used:
            used, matrix = wanted, persistence.matrix([stamps[one] for one in wanted])
            kriging = JointKriging(variogram, [samples[one] for one in used], matrix)
        before = used.index(number - 1) if number else None
        surveys.append(_mapped(run, kriging, place, used.index(number), before))
    title = settings.title or f"Season of {place.field_name}"
    notes = tuple(_notes(runs, now, place.illustrative))
    return Season(**vars(place), title=title, surveys=surveys, variogram=variogram, persistence=persistence,
                  created_utc=now, notes=notes)  # fmt: skip


def _notes(runs: Sequence[EarlierRun], now: datetime, illustrative: bool) -> Iterator[str]:
    """Remarks on the runs of a season, as sentences for the user."""
    if illustrative:
        yield "The calibration is illustrative: patterns and changes are real, the level of the moisture is not."
    typical = float(np.median([mean_rate(run.survey.samples) for run in runs]))
    for run in runs:
        for doubt in earlier_doubts(run, typical, now):
            yield f"The survey {run.survey.name} {doubt}"
    kept = [run for run in runs if (run.path / SUMMARY).is_file() and read_summary(run.path).get("covariates")]
    if informed := [run.survey.name for run in kept]:
        yield (
            f"Covariates inform the maps of {', '.join(informed)}, but not those of the season: it is made from "
            "counts alone."
        )


def _mapped(
    run: EarlierRun, kriging: JointKriging, ground: SeasonField, number: int, before: int | None
) -> SeasonSurvey:
    """Map a survey, and its change since the one before."""
    grid, curve = ground.grid, ground.curve
    cells, (places, share) = grid.cells, mean_places(grid)
    maps = {number: kriging.predict(cells, number)}
    rate, variance = maps[number]
    bands = make_bands(grid.to_raster(rate), grid.to_raster(variance), curve)
    mean = SurveysEstimate(float(rate.mean()), math.sqrt(kriging.mean(places, {number: share})[1]))
    mean_vwc = change = None
    if curve is not None:
        slopes = share * moisture_slope(curve, kriging.predict(places, number)[0])
        sd = math.sqrt(kriging.mean(places, {number: slopes})[1])
        mean_vwc = SurveysEstimate(float(np.nanmean(bands.vwc)), sd)
    if before is not None:
        if curve is not None:
            maps[before] = kriging.predict(cells, before)
        change = field_change(kriging, grid, number, before, curve, maps)
    return SeasonSurvey(run, bands, mean, mean_vwc, change)


def _window(samples: Sequence[Samples], stamps_s: Sequence[float], number: int) -> list[int]:
    """Surveys with which a survey is mapped: all, or of very many the one before and those nearest in time."""
    sizes = np.array([len(one) for one in samples])
    if sizes.sum() <= MAX_SAMPLES:
        return list(range(len(samples)))
    away = np.abs(np.subtract(stamps_s, stamps_s[number]))
    needed = [number, number - 1] if number else [number]
    away[needed] = -1.0
    order = np.argsort(away, kind="stable")
    count = max(int(np.searchsorted(np.cumsum(sizes[order]), MAX_SAMPLES, side="right")), len(needed))
    return sorted(order[:count].tolist())


def _variogram(runs: Sequence[EarlierRun], model: ModelName, grid: FieldGrid) -> Variogram:
    """Variogram of the rate of each survey, by restricted maximum likelihood of the last ones together."""
    last, *others = [run.survey.samples.merged for run in reversed(runs)]
    within = np.cumsum([len(last), *map(len, others)])[1:] <= MAX_FITTED
    chosen = others[: np.count_nonzero(within)]
    fit = estimate_variogram(
        last.xy, last.counts, last.exposure_s, model, extent_m=grid.extent_m, spread=last.spread,
        local_noise=True, others=chosen,
    )  # fmt: skip
    return fit.variogram


def _ground(runs: Sequence[Path], settings: SeasonSettings) -> SeasonField:
    """Field and calibration: from files, else from the last run that has a folder."""
    from shapely import get_parts, union_all

    summaries = [(path, read_summary(path)) for path in runs if (path / SUMMARY).is_file()]
    if not summaries:
        what = "a season of recordings alone does not know field and calibration"
        raise InputError(what, f"make one a run: soilmoist replay {runs[-1]} --out DIR", runs[-1])
    home, about = max(summaries, key=lambda one: one[1].get("last_stamp_s") or 0.0)
    curve, simulated = curve_of(about, home), bool(about.get("simulated"))
    illustrative, time_zone = curve is not None and is_illustrative(about), str(about.get("time_zone") or "")
    method = calibration_method(about)
    if settings.site:
        site = load_site(settings.site)
        curve, time_zone = site.curve, site.time_zone or time_zone
        illustrative = site.calibration is not None and site.calibration.illustrative
        method = "cores" if site.calibration is None else site.calibration.method
    given_m = settings.cell_m
    if settings.field:
        field = load_field(settings.field)
        name, frame = field.name, field.frame
        grid = _sized(field.grid, given_m, field.grid(given_m))
    elif (datum := about.get("datum")) is None:
        raise InputError("does not say where its datum lies", "give the field file with --field", home)
    else:
        name, frame = about.get("field") or "the field", LocalFrame(datum["latitude_deg"], datum["longitude_deg"])
        boundary, no_go, _ = field_shapes(open_run(home), frame)
        # No-go areas may part the field; as written, their borders meet to a centimetre.
        filled = union_all([boundary, *no_go]).buffer(0.05, join_style="mitre").buffer(-0.05, join_style="mitre")
        whole = max(get_parts(filled).tolist(), key=lambda part: float(part.area))
        outline, *holes = (np.asarray(part.exterior.coords)[:-1] for part in (whole, *no_go))
        make = partial(FieldGrid.from_polygon, outline, holes=holes)
        grid = _sized(make, given_m, make(given_m or float(about.get("cell_m") or 1.0)))
    names = [str(one.get("name", "")) for one in about.get("properties") or ()]
    return SeasonField(
        str(name), frame, grid, curve, names[0] if names else "", simulated, illustrative, time_zone, method
    )


def _sized(make: Callable[[float], FieldGrid], given_m: float | None, grid: FieldGrid) -> FieldGrid:
    """A grid of at most :data:`USUAL_CELLS`, unless its cell size is given."""
    cells = np.count_nonzero(grid.mask)
    if cells > MAX_CELLS:
        message = f"the maps of a season would have {cells} cells of {grid.cell_m:g} m each"
        raise InputError(message, f"give larger cells with --cell: at most {MAX_CELLS} are possible")
    if given_m is not None or cells <= USUAL_CELLS:
        return grid
    return make(grid.cell_m * math.ceil(math.sqrt(cells / USUAL_CELLS)))
