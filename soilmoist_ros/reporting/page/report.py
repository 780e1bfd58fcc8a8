# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The HTML report of a run, and of a run that made no map."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from soilmoist_ros.foundation import __version__
from soilmoist_ros.pipeline import FailedRun, MapRun, track_xy
from soilmoist_ros.reporting.certainty import ILLUSTRATIVE, calibration_of
from soilmoist_ros.reporting.moisture_steps import at_one_place, moisture_series
from soilmoist_ros.reporting.page import charts as survey_charts
from soilmoist_ros.reporting.page import numbers, wording
from soilmoist_ros.reporting.page.charts import Chart, rate_chart
from soilmoist_ros.reporting.page.frame import render_page
from soilmoist_ros.reporting.page.irrigation import irrigation
from soilmoist_ros.reporting.page.notes import notes
from soilmoist_ros.reporting.page.numbers import duration, length, number
from soilmoist_ros.reporting.page.sections import earlier_part, mission_part
from soilmoist_ros.reporting.page.statistics import TruthScore, covariate_importance, leave_one_out, truth_score
from soilmoist_ros.reporting.page.variogram_charts import variogram_charts
from soilmoist_ros.reporting.page.viewer import pictures, viewer_data
from soilmoist_ros.reporting.page.wording import Fact

FITS = {"reml": "restricted maximum likelihood", "soft_l1": "robust least squares on the lag classes"}
MAX_VISITS = 100
MAX_LINES = 1000


def write_report(path: Path, run: MapRun) -> Path:
    """Write the report; return ``path``."""
    path.write_text(render_report(run), encoding="utf-8")
    return path


def render_report(run: MapRun) -> str:
    """The report as HTML."""
    found = irrigation(run)
    variograms = list(variogram_charts(run))
    return render_page(
        "report.html.j2",
        title=run.title,
        version=run.version,
        place=run.field_name,
        when=wording.survey_time(run),
        where=wording.place(run),
        simulated=run.simulated,
        run=run,
        curve=run.soil_map.curve,
        facts=wording.facts(run),
        headline=wording.headline(run),
        notes=notes(run),
        irrigation=found,
        guessed=calibration_of(run) == ILLUSTRATIVE,
        series=_series(run),
        covariates=_covariate_rows(run),
        map_data=None if at_one_place(run) else viewer_data(run, found),
        pictures=() if at_one_place(run) else list(pictures(run)),
        earlier=earlier_part(run),
        mission=mission_part(run),
        variograms=[chart for chart, _ in variograms],
        classes=[classes for _, classes in variograms],
        charts=list(_charts(run)),
        truths=list(_truths(run)),
        model=_model_rows(run),
        outside=sum(row.count for row in run.losses if row.consequence != "kept"),
        datum=wording.datum(run),
    )


def _covariate_rows(run: MapRun) -> list[tuple[str, str, str, str]]:
    """Name, effect, share of the variance and coverage of each covariate, as texts."""
    rows = []
    for one in covariate_importance(run):
        effect, digits = (one.rate_cps, 2) if one.vwc is None else (one.vwc.times(100), 1)
        change = f"{effect.value:+.{digits}f} ({effect.p025:+.{digits}f} to {effect.p975:+.{digits}f})"
        if not any(one.rate_cps):
            rows.append((one.name, "left out", "none found", numbers.percent(one.covered_share)))
            continue
        share, low, high = (numbers.percent(value) for value in one.variance_share)
        rows.append((one.name, change, f"{share} ({low} to {high})", numbers.percent(one.covered_share)))
    return rows


def _series(run: MapRun) -> Chart | None:
    """Moisture over time of a probe that stays at one place, which has no zones."""
    if not (at_one_place(run) and run.calibrated):
        return None
    return survey_charts.moisture_chart(moisture_series(run.track, run.soil_map.curve))


def _charts(run: MapRun) -> Iterator[Chart]:
    """Charts of the scientist's part after the variogram."""
    loo = leave_one_out(run.soil_map)
    if loo is not None:
        yield survey_charts.cross_validation_chart(loo)
    if not at_one_place(run):
        yield survey_charts.histogram_chart(run)
    if len({record.stamp_s for record in run.track}) > 1:
        yield survey_charts.rate_chart(run.track)
        yield survey_charts.factor_chart(run.track)


def _truths(run: MapRun) -> Iterator[tuple[str, TruthScore]]:
    """Name and score of each property with a known truth."""
    for one in run.properties:
        if one.truth_rate is not None:
            yield one.label or one.name or "the map", truth_score(one.soil_map, one.truth_rate)


def _model_rows(run: MapRun) -> list[tuple[str, str, str]]:
    """Name, value and unit of each model parameter."""
    soil_map, variogram, fit = run.soil_map, run.soil_map.variogram, run.soil_map.fit
    errors = (None, None, None) if fit is None or fit.log_sd is None else fit.log_sd
    sill_factor, range_factor, nugget_factor = (_factor(error) for error in errors)
    rows = [
        ("model", str(variogram.model), ""),
        ("fitted by", "given, not fitted" if fit is None else FITS.get(fit.method, fit.method), ""),
        ("nugget", numbers.number(variogram.nugget) + nugget_factor, "(counts/s)²"),
        ("sill above the nugget", numbers.number(variogram.structured_sill) + sill_factor, "(counts/s)²"),
        ("total sill", numbers.number(variogram.sill), "(counts/s)²"),
        ("range parameter", numbers.number(variogram.range_m) + range_factor, "m"),
        ("practical range (95 % of the sill)", numbers.number(variogram.practical_range_m), "m"),
        ("mean rate", numbers.number(soil_map.mean_rate, 4), "counts/s"),
        ("samples", str(len(soil_map.samples.xy)), ""),
        ("cells inside the field", str(np.count_nonzero(soil_map.grid.mask)), ""),
        ("cell size", numbers.number(soil_map.grid.cell_m), "m"),
    ]
    if fit is not None and any(fit.prior_share):
        shares = ", ".join(numbers.percent(share) for share in fit.prior_share)
        rows.insert(2, ("influence of the prior on sill, range, nugget", shares, ""))
    if variogram.anisotropy > 1:
        root = float(np.sqrt(variogram.anisotropy))
        longest, shortest = (numbers.number(variogram.practical_range_m * factor) for factor in (root, 1 / root))
        along = f"{longest} along {variogram.angle_deg:.3g}°, {shortest} across"
        rows.append(("practical range by direction (anticlockwise from east)", along, "m"))
    if fit is not None and fit.local is not None:
        rows.append(("standard deviation of the rate", fit.local_text, ""))
    return rows


def _factor(log_sd: float | None) -> str:
    """The standard error of a logarithm as a multiplicative factor."""
    return "" if log_sd is None or not 0 < log_sd < 3 else f" ×/÷ {np.exp(log_sd):.2g}"


# The page of a run that made no map -----------------------------------------------------------------------------


def render_failed(failed: FailedRun) -> str:
    """The page as HTML: why there is no map, what to do, and what was counted."""
    mission = failed.mission
    return render_page(
        "failed.html.j2",
        title=failed.title,
        version=__version__,
        place=failed.field_name,
        when=wording.survey_time(failed),
        where=wording.place(failed),
        simulated=failed.simulated,
        failed=failed,
        facts=failed_facts(failed),
        visits=mission.visits[:MAX_VISITS] if mission else (),
        stops=len(mission.visits) if mission else 0,
        log=mission.log[:MAX_LINES] if mission else (),
        rate=_rate(failed),
    )


def failed_facts(failed: FailedRun) -> list[Fact]:
    """What was counted, and how far the run came."""
    good, placed = failed.good, len(track_xy(failed.good))
    counts, seconds = sum(record.raw_counts for record in good), sum(record.exposure_s for record in good)
    found = [Fact(str(len(good)), "", "records" if len(good) != 1 else "record")]
    if failed.quarantined:
        found.append(Fact(str(failed.quarantined.total()), "", "records quarantined"))
    if good:
        found += [
            Fact(str(placed), "", "records with a place"),
            Fact(str(counts), "", f"counts in {duration(seconds)}"),
            Fact(number(counts / seconds) if seconds > 0 else "–", "counts/s", "mean raw rate"),
        ]
    if failed.mission is not None:
        found.append(Fact(str(len(failed.mission.visits)), "", "stops finished"))
        if failed.mission.series:
            found.append(Fact(duration(failed.mission.series[-1].time_s), "", "of mission time"))
    if placed or failed.mission is not None:
        value, unit = length(failed.travelled_m)
        found.append(Fact(value, unit, "travelled"))
    return found


def _rate(failed: FailedRun) -> Chart | None:
    """The rate over time, ``None`` without at least two records that count."""
    good = [record for record in failed.good if record.effective_exposure_s > 0]
    if len({record.stamp_s for record in good}) < 2:
        return None
    return rate_chart(good)
