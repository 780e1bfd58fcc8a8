# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``summary.json``: the run in numbers, for programs. The names of the keys include the units."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from soilmoist_ros.exploration import polyline_length_m
from soilmoist_ros.foundation import __version__, shown_path
from soilmoist_ros.mapping import FieldChange, SurveysEstimate
from soilmoist_ros.pipeline import EarlierRun, FailedRun, MapRun, NoteCode, track_xy
from soilmoist_ros.reporting.budget import make_budget
from soilmoist_ros.reporting.certified import certificate_of
from soilmoist_ros.reporting.geometry import field_polygon
from soilmoist_ros.reporting.geotiff import model_parameters
from soilmoist_ros.reporting.one_place import at_one_place, moisture_of_all
from soilmoist_ros.reporting.page import statistics
from soilmoist_ros.reporting.page.decision import DecisionMap, decision
from soilmoist_ros.reporting.page.field_dose import has_level, root_zone
from soilmoist_ros.reporting.page.irrigation import IrrigationZone, irrigation
from soilmoist_ros.reporting.page.report import relations
from soilmoist_ros.reporting.page.statistics import band_statistics, calibration_sd
from soilmoist_ros.reporting.page.wording import notes
from soilmoist_ros.reporting.text_files import jsonable
from soilmoist_ros.simulation import PropertySettings, achieved, reported

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from soilmoist_ros.mapping import SoilMap
    from soilmoist_ros.simulation import MappedProperty, MissionResult, MissionSettings

TRAVEL = ("speed_mps", "stop_overhead_s")
"""Motion of a robot as the planner has learned it."""
GONE_TRAVEL = {"turn_s_per_rad": None, "overhead_counted": None}  # readers of earlier versions look for them
SCHEMA = 1
"""Version of the keys; rises when one is renamed or removed."""


def summary(run: MapRun, crs: str = "", outputs: Sequence[str] = ()) -> dict[str, Any]:
    """The run as a dictionary of plain JSON values; undefined values are ``None``.

    :param crs: coordinate reference system of the GeoTIFF; default the UTM zone of the datum
    :param outputs: names of the files written
    """
    soil_map, found, loo = run.soil_map, notes(run), statistics.leave_one_out(run.soil_map)
    content = {
        **_about(run, run.version), "time_zone": run.time_zone or None, "logger_format": run.logger_format,
        **_records(run), "area_m2": float(field_polygon(soil_map.grid).area),
        "cells": int(np.count_nonzero(soil_map.grid.mask)), "cell_m": float(soil_map.grid.cell_m),
        "datum": {"latitude_deg": run.frame.latitude_deg, "longitude_deg": run.frame.longitude_deg},
        "crs": crs or f"EPSG:{run.frame.export_epsg()}", "variogram": model_parameters(soil_map), "fit": _fit(run),
        "within_survey": _within_survey(soil_map), "map": _map(run),
        "covariates": [
            {
                "name": one.name, "rate_cps_per_sd": one.rate_cps._asdict(),
                "vwc_per_sd": one.vwc and one.vwc._asdict(), "variance_share": one.variance_share._asdict(),
                "covered_share": one.covered_share,
            }
            for one in statistics.covariate_importance(run)
        ],
        "cross_validation": loo
        and {"rmse_cps": loo.rmse, "standardised_sd": loo.standardised_sd, "coverage95": loo.coverage95},
        "truth": _truth(soil_map, run.truth_rate, decision(run)),
        "mission": None if run.mission is None else mission_summary(run.mission),
        "certificate": None if (stated := certificate_of(run)) is None else stated.values,
        "properties": [
            {
                "name": one.name, "label": one.label, "n_records": len(one.track),
                "n_samples": len(one.soil_map.samples), **_rate_map(one.soil_map, one.truth_rate),
                "budget": _budget(one),
            }
            for one in run.properties
        ],
        "earlier": [_earlier(one, relations(run)) for one in run.earlier], "change": _change(run),
        "corrections": [{**asdict(row), "parameters": dict(row.parameters)} for row in run.corrections],
        "calibration": _calibration(run), "budget": _budget(run), **_irrigation(run),
        "warnings": [note.message for note in found], "warning_codes": [note.code for note in found],
        "settings": dict(run.settings), "outputs": list(outputs),
    }  # fmt: skip
    return dict(jsonable(content))


def failed_summary(failed: FailedRun, outputs: Sequence[str] = ()) -> dict[str, Any]:
    """The run as plain JSON values: the known keys of :func:`summary`; ``map`` is ``None``."""
    content = {
        **_about(failed, __version__), "n_records": len(failed.good),
        "n_placed_records": len(track_xy(failed.good)),
        "n_lost": {row.kind: row.count for row in failed.losses if row.consequence == "lost"},
        "n_quarantined": dict(failed.quarantined), "raw_counts": sum(record.raw_counts for record in failed.good),
        "exposure_s": float(sum(record.exposure_s for record in failed.good)), "distance_m": failed.travelled_m,
        "map": None, "mission": None if failed.mission is None else mission_summary(failed.mission),
        "failure": {
            "why": failed.why, "what_to_do": list(failed.todo),
            "troubles": [asdict(trouble) for trouble in failed.troubles],
        },
        "warnings": [failed.why], "warning_codes": [NoteCode.NO_MAP], "settings": dict(failed.settings),
        "outputs": list(outputs),
    }  # fmt: skip
    return dict(jsonable(content))


def _about(run: MapRun | FailedRun, version: str) -> dict[str, Any]:
    """Origin of a run, with a map or without."""
    return {
        "schema": SCHEMA, "software": "soilmoist_ros", "version": version,
        "survey_start_utc": utc_text(run.survey_start_utc), "survey_end_utc": utc_text(run.survey_end_utc),
        "survey_duration_s": run.survey_duration_s, "created_utc": run.created, "simulated": run.simulated,
        "title": run.title, "site": run.site, "field": run.field_name,
        "inputs": [asdict(item) for item in run.inputs],
    }  # fmt: skip


def utc_text(when: datetime | None) -> str | None:
    """ISO 8601 in UTC, to the second."""
    return None if when is None else f"{when:%Y-%m-%dT%H:%M:%SZ}"


def _records(run: MapRun) -> dict[str, Any]:
    samples, stamps = run.soil_map.samples, [record.stamp_s for record in run.track]
    return {
        "n_records": len(run.track), "n_placed_records": len(track_xy(run.track)), "n_inside_field": run.inside[0],
        "n_lost": {row.kind: row.count for row in run.losses if row.consequence == "lost"},
        "n_kept_with_reservation": {row.kind: row.count for row in run.losses if row.consequence == "kept"},
        "n_quarantined": dict(Counter(record.quarantine for record in run.quarantined)),
        "first_stamp_s": min(stamps, default=None), "last_stamp_s": max(stamps, default=None),
        "exposure_s": float(sum(record.exposure_s for record in run.track)), "distance_m": run.travelled_m,
        "n_samples": len(samples.xy), "sample_counts": round(float(np.sum(samples.counts))),
        "sample_effective_exposure_s": float(np.sum(samples.exposure_s)),
    }  # fmt: skip


def _fit(run: MapRun) -> dict[str, Any] | None:
    """Fit of the variogram; ``None`` if it was given."""
    fit = run.soil_map.fit
    if fit is None:
        return None
    names = ("structured_sill", "range", "nugget")
    return {
        "method": fit.method, "converged": fit.converged, "objective": fit.objective,
        "log_sd": fit.log_sd and dict(zip(names, fit.log_sd, strict=True)),
        "prior_share": dict(zip(names, fit.prior_share, strict=True)),
        **({"other_fields": fit.other_fields} if fit.other_fields else {}),
        "local": None,  # key of earlier releases, in which the variance could differ from place to place
    }  # fmt: skip


def _within_survey(soil_map: SoilMap) -> dict[str, Any]:
    """Change of the mean rate during the survey."""
    change = soil_map.change
    drift, jump, shares = change.drift, change.jump, dict[str, float]()
    if drift is not None:  # from the first sample to the map, as a share and in counts/s
        shares = {"change": drift.change, "change_sd": drift.change_sd}
        shares |= {f"{name}_cps": soil_map.mean_rate * share for name, share in shares.items()}
    return {
        "text": change.text, "drift": drift and {**shares, **asdict(drift)},
        "jump": asdict(jump) if jump is not None and jump.is_certain else None,
    }  # fmt: skip


def _map(run: MapRun) -> dict[str, Any]:
    """Statistics of the bands and the mean of the field; ``sensed``: reach of 86 % of the counts."""
    soil_map, spread = run.soil_map, ("mean", "min", "max")
    bands = {"rate_cps": "rate", "rate_sd_cps": "rate_sd", "vwc": "vwc", "vwc_sd": "vwc_sd"}
    return {
        **{key: band_statistics(getattr(soil_map, name))._asdict() for key, name in bands.items()},
        "mean_rate_sd_cps": statistics.mean_sd(soil_map, moisture=False),
        "mean_vwc_sd": statistics.mean_sd(soil_map, moisture=True),
        "calibration_vwc_sd": calibration_sd(soil_map),
        **_moisture(run),
        "sensed": run.sensed
        and {
            "depth_d86_cm": dict(zip(spread, run.sensed.depth_cm, strict=True)),
            "radius_r86_m": dict(zip(spread, run.sensed.radius_m, strict=True)),
        },
        "support": run.support_text,
        "resolution_m": statistics.resolution_m(soil_map, run.footprint_radius_m or 0.0),
        "explained_share": statistics.explained_share(soil_map),
        "undefined_vwc_share": statistics.undefined_share(soil_map),
        "uncertain_share": statistics.uncertain_share(soil_map),
        "uncertain_above": {"vwc_sd": statistics.UNCERTAIN_VWC_SD}
        if run.calibrated
        else {"rate_sd_per_rate": statistics.UNCERTAIN_RATE_SHARE},
    }


def _moisture(run: MapRun) -> dict[str, Any]:
    """Moisture of the map and its uncertainty, for the summary; the mean at one place is that of its records."""
    soil_map, mean = run.soil_map, statistics.mean_moisture(run.soil_map)
    limits, common = soil_map.limits, calibration_sd(soil_map)
    known = mean and {"value": mean.value, "p05": mean.p05, "p95": mean.p95}
    if at_one_place(run) and run.calibrated:
        bands = moisture_of_all(run.track, soil_map.curve)
        known = {"value": float(bands.vwc), "p05": float(bands.vwc_p05), "p95": float(bands.vwc_p95)}
    return {
        "vwc_p05": band_statistics(soil_map.vwc_p05)._asdict(),
        "vwc_p95": band_statistics(soil_map.vwc_p95)._asdict(),
        "mean_vwc": known,
        "uncertainty_vwc": limits
        and {
            "everywhere_sd": common, "between_places_sd": band_statistics(soil_map.vwc_sd).p50,
            "quantiles_include_calibration": common is not None,
        },
        "limits_vwc": limits and limits._asdict(), "beyond_limits_share": statistics.beyond_limits_share(soil_map),
    }  # fmt: skip


def _earlier(one: EarlierRun, related: Mapping[str, float]) -> dict[str, Any]:
    """An earlier survey that informs the map."""
    return {
        "name": one.survey.name, "path": shown_path(one.path),
        "end_utc": utc_text(datetime.fromtimestamp(one.survey.stamp_s, UTC)) if one.date else None,
        "end_stamp_s": one.survey.stamp_s, "n_records": len(one.records), "n_samples": len(one.survey.samples),
        "n_outside": one.outside, "rate_scale": one.scale, "pattern_correlation": related.get(one.survey.name),
        "remarks": list(one.remarks),
    }  # fmt: skip


def _change(run: MapRun) -> dict[str, Any] | None:
    """Contribution of the earlier surveys, and the change since the latest of them, for the summary."""
    if run.change is None:
        return None
    found, change = run.change, run.change.change
    drier, wetter = change.shares
    decay_days = found.persistence.decay_days
    return {
        "since": found.since.survey.name, "pattern_correlation": found.persistence.share,
        "pattern_correlation_sd": found.persistence.sd,
        "pattern_decay_days": decay_days if math.isfinite(decay_days) else None, "rate_sd_cps": found.sd,
        "rate_sd_without_earlier_cps": found.sd_alone, "mean_rate_cps": _estimate(change.mean_rate),
        "mean_vwc": None if change.mean_vwc is None else _estimate(change.mean_vwc), "drier_share": drier,
        "wetter_share": wetter, "false_discovery_rate": FieldChange.FALSE_SHARE,
        "mean_rate_since_cps": {name: _estimate(value) for name, value in found.means.items()},
    }  # fmt: skip


def _estimate(estimate: SurveysEstimate) -> dict[str, float]:
    low, high = estimate.interval95
    return {"value": estimate.value, "sd": estimate.sd, "low95": low, "high95": high}


def _truth(
    soil_map: SoilMap, truth: NDArray[np.float64] | None, decided: DecisionMap | None = None
) -> dict[str, float] | None:
    if truth is None:
        return None
    score = statistics.truth_score(soil_map, truth)
    wrong = {} if decided is None or decided.true_wrong is None else {"wrong_zone_share": decided.true_wrong}
    return {"rmse_cps": score.rmse, "bias_cps": score.bias, "coverage95": score.coverage95, **wrong}


def mission_summary(mission: MissionResult) -> dict[str, Any]:
    """Settings and result of a simulated mission."""
    further = [_property(mapped) for mapped in mission.properties[1:]]
    return {
        "settings": settings_summary(mission.settings), "field": mission.field_title, "ended": mission.ended,
        "stops": len(mission.visits), "robot_distances_m": [polyline_length_m(track) for track in mission.tracks],
        "travel": [
            {name: getattr(learned.motion, name) for name in TRAVEL} | {"legs": len(learned.legs), **GONE_TRAVEL}
            for learned in mission.motion
        ],
        "forecast": _forecast(mission), "efficiency": None,  # a key stays for its readers, without a value
        "final": {name: column[-1].item() for name, column in mission.columns.items()} if mission.series else None,
        "properties": further, "also": further[0] if len(further) == 1 else None,
    }  # fmt: skip


def settings_summary(settings: MissionSettings) -> dict[str, Any]:
    """Settings of a mission; some are repeated under keys of earlier releases."""
    also = settings.properties[0] if len(settings.properties) == 1 else PropertySettings("")
    old = {"variogram": settings.model, "also": also.field, "also_weight": also.weight, "local": "off"}
    named = {**settings.as_dict(), **old}
    return {key: shown_path(value) if isinstance(value, str) else value for key, value in named.items()}


def _property(mapped: MappedProperty) -> dict[str, Any]:
    """A property of a mission after the first."""
    about = {"name": mapped.name, "field": mapped.title, "weight": mapped.weight, "n_records": len(mapped.records)}
    if mapped.soil_map is None:
        return {**about, "map": None}
    return {**about, **_rate_map(mapped.soil_map, mapped.known_truth)}


def _rate_map(soil_map: SoilMap, truth: NDArray[np.float64] | None) -> dict[str, Any]:
    bands = {"rate_cps": soil_map.rate, "rate_sd_cps": soil_map.rate_sd}
    return {
        "variogram": model_parameters(soil_map),
        "map": {name: band_statistics(values)._asdict() for name, values in bands.items()},
        "truth": _truth(soil_map, truth),
    }


def _forecast(mission: MissionResult) -> dict[str, Any] | None:
    """Standard deviation of the map that was forecast for the end, and that was reached.

    Of a rate map it is a share of the mean rate, of a moisture map it is in m^3/m^3.
    """
    end = achieved(mission.forecasts)
    if end is None:
        return None
    made = [
        {
            "time_s": one.time_s, "sd": one.forecast.sd, "end_s": one.time_s + one.forecast.times_s[-1],
            "sd_at_end": one.forecast.sd_end, "sd_at_end_low": one.forecast.band_end[0],
            "sd_at_end_high": one.forecast.band_end[1], "text": one.forecast.text,
        }
        for _, one in reported(mission.forecasts, 3600 * mission.settings.hours)
    ]  # fmt: skip
    unit = "m3/m3" if end.forecast.moisture else "share of the mean rate"
    return {"unit": unit, "made": made, "reached": {"time_s": end.time_s, "sd": end.forecast.sd}}


def _irrigation(run: MapRun) -> dict[str, Any]:
    """Zones of the field as in the report, relative without ``zone_limits_vwc``, and the dose."""
    found, limits, ground = irrigation(run), run.irrigation, root_zone(run)
    names = ("name", "area_m2", "share", "water_mm", "missing_mm", "missing_mm_p05", "missing_mm_p95")
    about = {
        "root_depth_mm": limits.root_depth_mm,
        "field_capacity_vwc": limits.field_capacity if has_level(run) else None,
        "moisture_usable": statistics.is_usable(run.soil_map) if run.calibrated else None,
        "zone_limits_vwc": found.edges, "root_zone": ground and ground[0].model_dump(),
        "zones": _zones(found.zones, names),
        "advice": found.advice,
    }  # fmt: skip
    parts = {"irrigation": about, "dose": found.dose and found.dose.content}
    if (decided := decision(run)) is not None:
        parts["decision"] = {
            "thresholds": decided.thresholds, "unit": "m3/m3" if decided.of_moisture else "counts/s",
            "outside": decided.outside, "wrong_share": decided.wrong, "wrong_share_band": decided.band,
            "zones": _zones(decided.zones, ("limits", "area_m2", "share")),
        }  # fmt: skip
    return parts


def _zones(zones: Sequence[IrrigationZone], names: Sequence[str]) -> list[dict[str, Any]]:
    """Zones with their certainty."""
    return [
        {name: getattr(zone, name) for name in names}
        | {"certain": sure.certain, "certain_share": sure.sure, "expected_share": sure.expected}
        for zone, sure in ((zone, zone.certainty) for zone in zones)
    ]


def _budget(run: MapRun) -> dict[str, Any] | None:
    """The uncertainty budget of a map; ``None`` if no cell has a value."""
    found = make_budget(run)
    return None if found is None else {**asdict(found), "beyond": [one._asdict() for one in found.beyond]}


def _calibration(run: MapRun) -> dict[str, Any] | None:
    """The calibration curve, with its origin if the run knows it."""
    curve, known = run.soil_map.curve, run.calibration
    if curve is None:
        return None
    return {
        **curve.parameters, "n0_sd_cps": known.n0_sd_cps if known else None,
        "lowest_rate_cps": curve.lowest_rate_cps, "source": known.source if known else "",
        "illustrative": known is not None and known.illustrative,
        **({} if known is None or known.method == "cores" else {"method": known.method}),
        **({"parts": [part.model_dump() for part in known.parts]} if known and known.parts else {}),
    }  # fmt: skip
