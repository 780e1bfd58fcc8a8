# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The HTML report of a run, and of a run that made no map."""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import SimpleNamespace as Part

import numpy as np

from soilmoist_ros.exploration import polyline_length_m
from soilmoist_ros.foundation import __version__
from soilmoist_ros.mapping import FieldChange, SurveysEstimate
from soilmoist_ros.pipeline import EarlierRun, FailedRun, MapRun, RunChange, track_xy
from soilmoist_ros.reporting.budget import make_budget
from soilmoist_ros.reporting.certainty import has_no_level
from soilmoist_ros.reporting.certified import certificate_text
from soilmoist_ros.reporting.one_place import at_one_place
from soilmoist_ros.reporting.page import wording
from soilmoist_ros.reporting.page.charts import Chart, Line, cross_validation_chart, factor_chart, rate_chart
from soilmoist_ros.reporting.page.decision import decision
from soilmoist_ros.reporting.page.frame import (
    duration,
    dwell_text,
    length,
    number,
    percent,
    plain,
    render_page,
    strategy_text,
    volume,
    with_interval,
    with_sd,
)
from soilmoist_ros.reporting.page.irrigation import irrigation
from soilmoist_ros.reporting.page.statistics import covariate_importance, leave_one_out, truth_score
from soilmoist_ros.reporting.page.variogram_chart import sample_variogram, variogram_chart
from soilmoist_ros.reporting.page.viewer import pictures, viewer_data
from soilmoist_ros.reporting.page.wording import notes
from soilmoist_ros.simulation import MissionResult, forecast_texts, series_columns

FITS = {"reml": "restricted maximum likelihood", "soft_l1": "robust least squares on the lag classes"}


def render_report(run: MapRun) -> str:
    """The report as HTML."""
    found, still = irrigation(run), at_one_place(run)  # a probe that stays at one place has no map
    classes, curve = sample_variogram(run.soil_map), run.soil_map.curve
    return render_page(
        "report.html.j2", title=run.title, version=run.version, place=run.field_name,
        when=wording.survey_time(run), where=wording.place(run), simulated=run.simulated, run=run, curve=curve,
        facts=wording.facts(run), support=wording.support(run), notes=notes(run), irrigation=found,
        guessed=has_no_level(run), decision=decision(run),
        covariates=covariate_rows(run), map_data=None if still else viewer_data(run, found),
        pictures=() if still else list(pictures(run)),
        budgets=[part for one in run.properties if (part := budget_part(one)) is not None],
        certified=certificate_text(run), earlier=earlier_part(run), mission=mission_part(run),
        variogram=classes and variogram_chart(run.soil_map, classes), classes=classes, charts=list(_charts(run)),
        truths=[
            (one.label or one.name or "the map", truth_score(one.soil_map, one.truth_rate))
            for one in run.properties
            if one.truth_rate is not None
        ],
        model=_model_rows(run), outside=sum(row.count for row in run.losses if row.consequence != "kept"),
        datum=wording.datum(run),
    )  # fmt: skip


def budget_part(run: MapRun) -> Part | None:
    """The uncertainty budget of a map as texts: rows of its parts, sums, and of what is not in it."""
    found = make_budget(run)
    if found is None:
        return None
    moist = run.calibrated

    def shown(value: float) -> str:
        text = volume(value) if moist else f"{100 * value:.1f}"
        return "–" if not value > 0 else text if text != "0.0" else "< 0.1"

    rows = []
    for part in found.parts:
        sure = with_sd(part.value, part.sd) if math.isfinite(part.value) else f"± {number(part.sd)}"
        value = f"{sure if part.sd > 0 else plain(part.value)} {part.unit}".strip(" –")
        about = ", ".join(filter(None, (value, part.origin, part.distribution)))
        rows.append((part.name[:1].upper() + part.name[1:], about, shown(part.level), shown(part.place)))
    beyond = [
        (one.name[:1].upper() + one.name[1:], "corrected" if one.corrected else "not accounted for", one.remark,
         f"± {shown(one.remainder)}" if one.remainder > 0 else "unknown")
        for one in found.beyond
    ]  # fmt: skip
    level = "unknown" if moist and math.isnan(found.level_sd) else shown(found.level_sd)
    return Part(
        name=run.label or run.name, unit="% vol." if moist else "% of the rate",
        rows=[*rows, ("Sum", "", level, shown(found.place_sd))], beyond=beyond, text=found.text,
        largest=found.largest, remedy=found.remedy,
    )  # fmt: skip


def covariate_rows(run: MapRun) -> list[tuple[str, str, str, str]]:
    """Name, effect, share of the variance and coverage of each covariate, as texts; one left out has no effect."""
    rows = []
    for one in covariate_importance(run):
        effect, digits = (one.rate_cps, 2) if one.vwc is None else (one.vwc.times(100), 1)
        change = f"{effect.value:+.{digits}f} ({effect.p025:+.{digits}f} to {effect.p975:+.{digits}f})"
        if not any(one.rate_cps):
            rows.append((one.name, "", "", percent(one.covered_share)))
            continue
        share, low, high = (percent(value) for value in one.variance_share)
        rows.append((one.name, change, f"{share} ({low} to {high})", percent(one.covered_share)))
    return rows


def _charts(run: MapRun) -> Iterator[Chart]:
    """Charts of the scientist's part after the variogram."""
    loo = leave_one_out(run.soil_map)
    if loo is not None:
        yield cross_validation_chart(loo)

    if len({record.stamp_s for record in run.track}) > 1:
        yield rate_chart(run.track)
        yield factor_chart(run.track)


def _model_rows(run: MapRun) -> list[tuple[str, str, str]]:
    """Name, value and unit of each model parameter."""
    soil_map, variogram, fit = run.soil_map, run.soil_map.variogram, run.soil_map.fit
    errors = fit.log_sd if fit is not None and fit.log_sd is not None else (0.0, 0.0, 0.0)
    # The standard error of a logarithm is a factor.
    sill_factor, range_factor, nugget_factor = (f" ×/÷ {np.exp(sd):.2g}" if 0 < sd < 3 else "" for sd in errors)
    rows = [
        ("model", str(variogram.model), ""),
        ("fitted by", "given, not fitted" if fit is None else FITS.get(fit.method, fit.method), ""),
        ("nugget", number(variogram.nugget) + nugget_factor, "(counts/s)²"),
        ("sill above the nugget", number(variogram.structured_sill) + sill_factor, "(counts/s)²"),
        ("total sill", number(variogram.sill), "(counts/s)²"),
        ("range parameter", number(variogram.range_m) + range_factor, "m"),
        ("practical range (95 % of the sill)", number(variogram.practical_range_m), "m"),
        ("mean rate", number(soil_map.mean_rate, 4), "counts/s"), ("samples", str(len(soil_map.samples.xy)), ""),
        ("cells inside the field", str(np.count_nonzero(soil_map.grid.mask)), ""),
        ("cell size", number(soil_map.grid.cell_m), "m"),
    ]  # fmt: skip
    if fit is not None and any(fit.prior_share):
        shares = ", ".join(percent(share) for share in fit.prior_share)
        rows.insert(2, ("influence of the prior on sill, range, nugget", shares, ""))
    if fit is not None and fit.other_fields:
        rows.insert(2, ("surveys of other fields", fit.other_fields, ""))
    if variogram.anisotropy > 1:
        root = float(np.sqrt(variogram.anisotropy))
        longest, shortest = (number(variogram.practical_range_m * factor) for factor in (root, 1 / root))
        along = f"{longest} along {variogram.angle_deg:.3g}°, {shortest} across"
        rows.append(("practical range by direction (anticlockwise from east)", along, "m"))
    return rows


# The page of a run that made no map -----------------------------------------------------------------------------


def render_failed(failed: FailedRun) -> str:
    """The page as HTML: why there is no map, what to do, and what was counted."""
    mission, good = failed.mission, [record for record in failed.good if record.effective_exposure_s > 0]
    return render_page(
        "failed.html.j2", title=failed.title, version=__version__, place=failed.field_name,
        when=wording.survey_time(failed), where=wording.place(failed), simulated=failed.simulated, failed=failed,
        placed=len(track_xy(failed.good)), visits=mission.visits[:MAX_VISITS] if mission else (),
        stops=len(mission.visits) if mission else 0, log=mission.log[:MAX_LINES] if mission else (),
        rate=rate_chart(good) if len({record.stamp_s for record in good}) > 1 else None,
    )  # fmt: skip


# Sections of a report on earlier surveys and on the mission -----------------------------------------------------

MAX_VISITS = 100
MAX_LINES = 1000


def earlier_part(run: MapRun) -> Part | None:
    """Contribution of earlier surveys and change since, as texts, and rows of a table; ``None`` without any."""
    if not run.earlier:
        return None
    found, related = run.change, relations(run)
    rows = [
        Part(
            name=one.survey.name, date=one.date or "no date", records=len(one.records),
            samples=len(one.survey.samples), change=_since(run, one.survey.name), remarks=" ".join(one.remarks),
            relation=f"{related[one.survey.name]:.2f}" if one.survey.name in related else "",
        )
        for one in run.earlier
    ]  # fmt: skip
    text = "The counts of earlier surveys inform this map." + (f" {contribution(found)}" if found else "")
    return Part(text=text, change=found and change_text(found), rows=rows)


def relations(run: MapRun) -> dict[str, float]:
    """Correlation of the pattern of each earlier survey with that of the present one, as the map has it."""
    fit = run.soil_map.fit
    if fit is None or fit.prior is None:
        return {}
    return {one.name: one.correlation for one in fit.prior.relations}


def contribution(found: RunChange) -> str:
    """Similarity of the surveys, and what the earlier ones contribute, in sentences."""
    share = 1 - found.sd / found.sd_alone if found.sd_alone > 0 else 0.0
    persistence, fades = found.persistence, ""
    if persistence.decay_days < 1e6:
        fades = f" It falls to a third in {number(persistence.decay_days, 2)} days."
    return (
        f"The patterns of two surveys of this field have a correlation of {persistence.share:.2f} ± "
        f"{persistence.sd:.2f}.{fades} They lower the standard deviation of the smooth rate from "
        f"{number(found.sd_alone, 2)} to {number(found.sd, 2)} counts/s, by {percent(share)}."
    )


def change_text(found: RunChange) -> str:
    """Change since the latest earlier survey, in sentences."""
    drier, wetter = found.change.shares
    kind = "rate" if found.change.mean_vwc is None else "moisture"
    low, high = (found.change.mean_vwc or found.change.mean_rate).interval95
    changed = low > 0 or high < 0
    seen = f"the mean {kind} has changed by" if changed else f"no change of the mean {kind} can be seen:"
    since = _change_since(found)
    return (
        f"{since[:1].upper()}{since[1:]}, {seen} {_change_amount(found)}. {percent(wetter)} of the field has "
        f"become wetter and {percent(drier)} drier significantly: of the cells called changed, "
        f"{percent(FieldChange.FALSE_SHARE)} at most are expected not to be. The uncertainty is that of both "
        "surveys together."
    )


def _change_amount(found: RunChange) -> str:
    """Change of the field's mean with its 95 % interval: of the moisture, or of the rate without a calibration."""
    rate, vwc = found.change.mean_rate, found.change.mean_vwc
    return _rate(rate) if vwc is None else f"{with_interval(vwc, True, '+')} % by volume"


def _change_since(found: RunChange) -> str:
    """Survey that a change compares with, in words."""
    return f"{'compared with the later survey' if found.backwards else 'since the survey'} {dated(found.since)}"


def dated(run: EarlierRun) -> str:
    """Name of an earlier survey, with its day if known."""
    return f"{run.survey.name}{f' of {run.date}' if run.date else ''}"


def _since(run: MapRun, name: str) -> str:
    """Change of the mean since a survey: of the rate, and of the moisture since the latest one."""
    change = None if run.change is None else run.change.means.get(name)
    if run.change is None or change is None:
        return ""
    latest = run.change.since.survey.name == name and run.change.change.mean_vwc is not None
    return f"{_change_amount(run.change)} [{change.value:+.3f} counts/s]" if latest else _rate(change)


def _rate(change: SurveysEstimate) -> str:
    return f"{with_interval(change, False, '+')} counts/s"


# Report section of the mission: its course over time and its stops ----------------------------------------------


def mission_part(run: MapRun) -> Part | None:
    """The course of a mission in sentences and charts, its first stops, how many are left out, and its log."""
    mission = run.mission
    if mission is None:
        return None
    visits = mission.visits
    return Part(
        text=". ".join(mission_sentences(mission)) + ".",
        charts=list(course_charts(mission)),
        visits=visits[:MAX_VISITS], stops=len(visits), several=len(mission.tracks) > 1,
        log=mission.log[:MAX_LINES],
    )  # fmt: skip


def mission_sentences(mission: MissionResult) -> list[str]:
    """The course and the result of a mission, in sentences without their full stops."""
    settings, named = mission.settings, mission.settings.as_dict()
    sentences = [
        f"Strategy {strategy_text(named['strategy'])}, dwell rule {dwell_text(named['dwell'])}, "
        f"{settings.hours:g} h, seed {settings.seed}: {len(mission.visits)} measurements"
    ]
    if mission.series:
        end = mission.series[-1]
        sentences[0] += f" in {duration(end.time_s)} and on {' '.join(length(end.distance_m))}"
        if end.time_s > 0:
            share = end.counting_s / (end.time_s * settings.robots)
            sentences[0] += f", {percent(share)} of the time spent counting"
        if settings.robots > 1:
            each = ", ".join(" ".join(length(polyline_length_m(track))) for track in mission.tracks)
            sentences.append(f"There were {settings.robots} robots, which drove {each}")
        if np.isfinite(end.mse):
            sentences.append(
                f"At the end the map has a mean squared error of {number(end.mse)} (counts/s)², which is "
                f"{number(end.mse_10s)} (counts/10 s)²"
            )
            if np.isfinite(end.vwc_rmse):
                moist = f"{number(100 * end.vwc_rmse, 2)} % by volume with the true N0"
                sentences[-1] += f", and a root mean squared error of {moist}"
            sentences[-1] += f"; the truth lies in the 95 % interval on {percent(end.coverage95)} of the field"
    for index, mapped in enumerate(mission.properties[1:], start=1):
        planned = f"planned for with the weight {mapped.weight:g}" if mapped.weight else "not planned for"
        sentences.append(f"A further property ({mapped.title}) was mapped, {planned}")
        if mission.series and np.isfinite((errors := mission.series[-1].errors[index]).mse):
            sentences[-1] += (
                f": its map has a mean squared error of {number(errors.mse)} (counts/s)², and the truth lies in "
                f"the 95 % interval on {percent(errors.coverage95)} of the field"
            )
    if forecast := forecast_texts(mission.forecasts, 3600 * settings.hours):
        sentences.append(f"Standard deviation of the map: {'; forecast '.join(forecast)}")
    if mission.ended:
        sentences.append(f"The mission ended: {mission.ended.rstrip('.')}")
    return sentences


def course_charts(mission: MissionResult) -> Iterator[Chart]:
    """Error and coverage against time; none without a truth."""
    if not mission.series:
        return
    columns = series_columns(mission.series, [""])
    hours = columns["time_s"] / 3600
    x = (0.0, max(float(hours[-1]), 1e-9))
    known = columns["mse"][np.isfinite(columns["mse"]) & (columns["mse"] > 0)]
    if len(known) and np.isfinite(mission.truth_rate).any():
        logarithm = np.log10(np.where(columns["mse"] > 0, columns["mse"], np.nan))
        low, high = math.floor(np.log10(known.min())), math.ceil(np.log10(known.max()) + 1e-9)
        steps = (1, 2, 5) if high - low <= 2 else (1,)
        ticks = [(e + math.log10(m), f"{m * 10.0**e:.6g}") for e in range(low, high + 1) for m in steps]
        yield Chart(
            "course-error", "Error of the map", "Mean squared error of the rate map against mission time",
            [Line(hours, logarithm)], x, (float(low), float(high)), "Mission time [h]",
            "Mean squared error [(counts/s)²], logarithmic",
            "Mean squared error of the rate map; multiply by 100 for (counts/10 s)².", y_ticks=ticks,
        )  # fmt: skip
        coverage = 100 * columns["coverage95"]
        yield Chart(
            "course-coverage", "Coverage", "Coverage of the 95 % intervals against mission time",
            [Line(x, (95, 95), "orange", "95 %, as stated", dashed=True), Line(hours, coverage, name="reached")],
            x, (min(50.0, float(np.nanmin(coverage, initial=100.0)) - 5), 102.0), "Mission time [h]",
            "Coverage [%]", "Share of the field whose true rate lies in the 95 % interval of the map.",
        )  # fmt: skip
