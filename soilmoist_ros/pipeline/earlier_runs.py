# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Finished runs as earlier surveys of the field that is being mapped (``--earlier RUN``)."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import accumulate, combinations, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from soilmoist_ros import mapping
from soilmoist_ros.foundation import DAY_S, InputError, LocalFrame, Mistake, distance_text, resource
from soilmoist_ros.pipeline.results import calibration_method, curve_of, read_summary
from soilmoist_ros.pipeline.run import EarlierRun, RunChange
from soilmoist_ros.recording import (
    RECORDS,
    SUMMARY,
    bag_of,
    configuration_of,
    read_earlier,
    read_parameters,
    read_records,
)
from soilmoist_ros.sensing import UNKNOWN_SENSOR, CountRecord, MoistureCurve, load_site

if TYPE_CHECKING:
    from soilmoist_ros.simulation import MappedProperty, MissionSettings

FIRST_NAMES = ("", "moisture")  # names of the robot's own property, which is no name to compare
SAME_RECORDS = 0.5
"""Share of equal stamps and counts from which two runs are one survey; by chance it is a twentieth."""
SAME_SENSOR = 0.01  # relative difference of their rates over equal soil up to which two sensors are one
MAX_AHEAD_S = DAY_S
"""Time after that of the report up to which a record may be dated [s]: clocks of loggers are local."""
MAX_RATE_RATIO = 2.0
"""Largest ratio of the mean rates of two surveys without a doubt: dry to saturated soil (Desilets 2010)."""
MAX_YEARS = 5.0  # longest time between two surveys without a doubt
_YEAR_S = 365.25 * DAY_S
MAX_SAMPLES = 1500
"""Number of samples of all surveys up to which a change is computed; the latest earlier surveys come first."""
EARLIER = "earlier"
"""Folder in the output of a mission with the runs of its simulated earlier surveys."""


@dataclass(frozen=True)
class RunRecords:
    """The good records of a finished run (folder or recording) in order of time, and the plane of their places.

    :param property_name: name of the property that they count; empty if the run does not name it
    :param corrections: parameters of each applied correction by its name, ``None`` if the run does not say
    """

    path: Path
    frame: LocalFrame
    records: Sequence[CountRecord]
    property_name: str = ""
    simulated: bool = False
    curve: MoistureCurve | None = None
    corrections: Mapping[str, Mapping[str, Any]] | None = None


def find_runs(path: Path) -> list[Path]:
    """The runs at a path: the path itself, or all runs in a folder of runs, by name.

    :raises InputError: if there is none
    """
    whole = path.parent if path.name == RECORDS and (path.parent / SUMMARY).is_file() else path
    if _is_run(whole):
        return [whole]
    inside = sorted(one for one in whole.iterdir() if _is_run(one)) if whole.is_dir() else []
    if inside:
        return inside
    why = "does not exist" if not path.exists() else f"is neither a run ({SUMMARY} and {RECORDS}) nor a recording"
    raise InputError(why, "give the folder that --out of a run named, a recording, or a folder of such", path)


def _is_run(path: Path) -> bool:
    if path.is_file():
        return path.suffix in (".mcap", ".db3")
    bag = bag_of(path)
    return (path / SUMMARY).is_file() or (bag / "metadata.yaml").is_file() or any(bag.glob("*.mcap"))


def read_run(path: Path, name: str = "", first: bool = True) -> RunRecords | None:
    """The records of a run.

    :param path: one of :func:`find_runs`
    :param name: name of the property to read
    :param first: whether it is the robot's own, which may be without a name
    :returns: ``None`` if the run does not have this further property
    :raises InputError: if the run has no records, not this property, or does not say where it was
    """
    return _of_folder(path, name, first) if (path / SUMMARY).is_file() else _of_bag(path, "" if first else name)


def _of_folder(path: Path, name: str, own: bool) -> RunRecords | None:
    """Records of an output folder."""
    about = read_summary(path)
    datum = about.get("datum")
    if datum is None:
        message = "is not the summary of a mapped run: datum is missing"
        raise InputError(message, "make the run again", path / SUMMARY)
    names = [one.get("name", "") for one in about.get("properties") or ()]
    first = names[0] if names else ""
    if name not in names[1:] and not own and name != first:
        return None
    table, found = (path / f"records_{name}.csv", name) if name in names[1:] else (path / RECORDS, first)
    if found != name and not {found, name} & set(FIRST_NAMES):
        raise InputError(
            f"is a run of the property {', '.join(map(repr, names))}, not of {name!r}",
            "give a run of the same property: the pattern of another one is not that of this one",
            path,
        )
    if not table.is_file():
        remedy = "make the run again with this version, or give its recording"
        raise InputError(f"has no {table.name}", remedy, path)
    rows = about.get("corrections") or ()
    return RunRecords(
        path, LocalFrame(datum["latitude_deg"], datum["longitude_deg"]), _good(read_records(table), path), found,
        bool(about.get("simulated")),
        curve_of(about, path) if found == first and calibration_method(about) != UNKNOWN_SENSOR else None,
        {row["name"]: row.get("parameters") or {} for row in rows} if rows else None,
    )  # fmt: skip


def _of_bag(path: Path, name: str) -> RunRecords | None:
    """Records of a recording, in the plane of the field that its nodes had; the robot's own without a name."""
    bag = bag_of(path)
    mapper = read_parameters(configuration_of(bag), f"{name.strip('/')}/mapper".strip("/"))
    if name and not mapper:
        return None
    if not mapper.get("field"):
        remedy = "map it with soilmoist replay --field, and give the folder of that"
        raise InputError("does not say in which field it was recorded", remedy, path)
    site = load_site(resource("sites", str(mapper["site"]))) if mapper.get("site") else None
    frame = mapping.load_field(resource("fields", str(mapper["field"]))).frame
    records, simulated = _good(read_earlier(bag, name), path), bool(mapper.get("simulated"))
    return RunRecords(path, frame, records, name, simulated, None if site is None else site.curve)


def _good(records: Sequence[CountRecord], path: Path) -> list[CountRecord]:
    """Records that a map can use."""
    good = [
        one
        for one in records
        if not one.quarantine
        and 0 < one.effective_exposure_s < math.inf
        and all(map(math.isfinite, (one.stamp_s, one.x_m, one.y_m)))
    ]
    if not good:
        raise InputError(f"has no usable record among {len(records)}", "leave it out", path)
    return sorted(good, key=lambda record: record.stamp_s)


@dataclass(frozen=True, eq=False)
class EarlierTarget:
    """The map that is being made, which earlier surveys must fit.

    :param name: name of the property; may be empty for the robot's own
    :param first: whether it is the robot's own; runs without a further property are left out
    :param simulated: whether its counts are simulated, ``None`` if either may be
    """

    frame: LocalFrame
    grid: mapping.FieldGrid
    settings: mapping.FieldMapSettings
    name: str = ""
    first: bool = True
    simulated: bool | None = None


def read_earlier_runs(paths: Sequence[Path | str], target: EarlierTarget) -> tuple[EarlierRun, ...]:
    """Earlier surveys of a field from finished runs, in order of time.

    Counts and effective exposures are taken, not the maps; records are merged as those of the present survey, and
    moved to its plane if the datum differs. Where both sensors are calibrated, the exposures are scaled by the
    ratio of the rates of both over the soil of the earlier survey: ``counts ~ Poisson(scale * rate * exposure)``,
    so the rates are those that the present sensor would count, and the counts stay Poisson.

    :param paths: output folders, recordings, or folders of such
    :raises InputError: with all that cannot be used: no run, another property or field, a survey given twice
    """
    found: list[EarlierRun] = []
    mistakes: list[Mistake] = []
    for path in paths:
        try:
            runs = [read_run(one, target.name, target.first) for one in find_runs(Path(path).expanduser())]
            found += [_earlier(run, target) for run in runs if run is not None]
        except InputError as error:
            mistakes += error.mistakes
    mistakes += [
        Mistake(f"is the same survey as {other.path}", "give it once", run.path)
        for other, run in combinations(found, 2)
        if same_survey(run.records, other.records)
    ]
    if mistakes:
        raise InputError(mistakes)
    return tuple(sorted(_named(found), key=lambda run: run.survey.stamp_s))


def require_other(runs: Sequence[EarlierRun], records: Sequence[CountRecord]) -> None:
    """Refuse an earlier survey that is the present one (``InputError``): its counts would be used twice."""
    for run in runs:
        if same_survey(run.records, records):
            message = "is the survey that is being mapped: its counts would be used twice"
            raise InputError(message, "leave it out", run.path)


def with_corrections(run: EarlierRun, applied: Mapping[str, Mapping[str, Any]]) -> EarlierRun:
    """A run with a remark if its counts were corrected otherwise than those of the present survey."""
    if run.corrections is None:
        return run
    names = sorted({*applied, *run.corrections})
    other = [name for name in names if dict(applied.get(name, {})) != dict(run.corrections.get(name, {}))]
    if not other:
        return run
    remark = f"Corrected otherwise: {', '.join(other)}. Its mean is free, but its pattern may differ a little."
    return replace(run, remarks=(*run.remarks, remark))


def same_survey(first: Sequence[CountRecord], second: Sequence[CountRecord]) -> bool:
    """True if most records of the shorter survey are in the other one: stamp, counts and exposure."""
    keys = [
        Counter((one.stamp_s, one.raw_counts, one.exposure_s) for one in records) for records in (first, second)
    ]
    shorter = min(len(first), len(second))
    return shorter > 0 and (keys[0] & keys[1]).total() > SAME_RECORDS * shorter


def _earlier(run: RunRecords, target: EarlierTarget) -> EarlierRun:
    """A run as an earlier survey; an error if it does not fit."""
    if target.simulated is not None and run.simulated != target.simulated:
        kinds = ("measured", "simulated")
        message = f"its counts are {kinds[run.simulated]}, those of this survey {kinds[target.simulated]}"
        raise InputError(message, "give runs of the same kind", run.path)
    records, outside = _inside(run, target)
    remarks = []
    if outside:
        remarks.append(f"{outside} of {len(run.records)} records lie outside the field and are left out.")
    settings, grid = target.settings, target.grid
    radius_m = settings.merge_radius_m
    if radius_m is None:
        radius_m = mapping.default_merge_radius_m(grid, settings.margin_m)
    if settings.drift_model == "off":
        samples = mapping.survey_samples(records, radius_m, settings.sample_radius_m)
    else:
        samples = mapping.samples_at_end(records, radius_m, settings.sample_radius_m, grid.extent_m)
    scale = _scale(run.curve, settings.curve, samples)
    if scale != 1.0:
        samples = replace(samples, exposure_s=samples.exposure_s * scale)
        remarks.append(
            f"By the calibrations, its sensor counts {scale:.3g} times as much over equal soil; its exposures are "
            "scaled. If it is the same sensor, map that survey again with the present site file."
        )
    survey = mapping.EarlierSurvey(run.path.name or str(run.path), records[-1].stamp_s, samples)
    begin_s = records[0].stamp_s - records[0].exposure_s
    return EarlierRun(survey, run.path, begin_s, records, outside, scale, tuple(remarks), run.corrections)


def _scale(its: MoistureCurve | None, curve: MoistureCurve | None, samples: mapping.Samples) -> float:
    """Rate of a survey's sensor relative to that of the present one over the survey's mean moisture; 1 if unknown.

    N0 alone does not compare sensors: it depends on the curve, and on the water terms of the soil.
    """
    if its is None or curve is None:
        return 1.0
    vwc = mapping.possible_moisture(its, samples.counts.sum() / samples.exposure_s.sum())
    scale = float(its.rate_cps(vwc) / curve.rate_cps(vwc))
    return 1.0 if abs(scale - 1) <= SAME_SENSOR else scale


def _inside(run: RunRecords, target: EarlierTarget) -> tuple[list[CountRecord], int]:
    """Records in the field and its margin, one at least, in its plane, and the number of the others."""
    import shapely

    xy = np.array([(record.x_m, record.y_m) for record in run.records])
    moved = run.frame != target.frame
    if moved:
        xy = target.frame.to_local(*run.frame.to_geographic(xy).T)
    area = shapely.Polygon(target.grid.polygon)
    with np.errstate(invalid="ignore"):
        distance_m = np.nan_to_num(shapely.distance(area, shapely.points(xy)), nan=np.inf)
    near = distance_m <= target.settings.margin_m
    if not near.any():
        least_m = float(distance_m.min())
        how_far = f"{distance_text(least_m)} away" if np.isfinite(least_m) else "on the other side of the earth"
        raise InputError(
            f"does not overlap with the field: the nearest of its records lies {how_far}",
            "give surveys of this field, or correct the datum of a field file",
            run.path,
        )
    kept = [
        replace(record, x_m=float(x), y_m=float(y)) if moved else record
        for record, (x, y), wanted in zip(run.records, xy, near, strict=True)
        if wanted
    ]
    return kept, len(run.records) - len(kept)


def _named(runs: Sequence[EarlierRun]) -> list[EarlierRun]:
    """Runs with names that differ: those of equal names are named by their paths below a common folder."""
    counts, paths = Counter(run.survey.name for run in runs), [run.path.absolute() for run in runs]
    names = [path.relative_to(os.path.commonpath(paths)).as_posix() for path in paths]
    return [
        replace(run, survey=replace(run.survey, name=name)) if counts[run.survey.name] > 1 else run
        for run, name in zip(runs, names, strict=True)
    ]


def earlier_doubts(run: EarlierRun, rate_cps: float, now: datetime, end: datetime | None = None) -> Iterator[str]:
    """Doubts about an earlier survey; each is a sentence that follows its name.

    :param rate_cps: mean rate of the survey that it is compared with, in counts of the same sensor [counts/s]
    :param end: end of the survey that it is compared with; ``None`` for any, or for a clock without a date
    """
    stamp_s = run.survey.stamp_s
    years = 0.0 if end is None else abs(stamp_s - end.timestamp()) / _YEAR_S
    if run.date and stamp_s - now.timestamp() > MAX_AHEAD_S:
        yield f"is dated {run.date}, in the future: check the clock of its logger, or leave it out."
    elif run.date and years > MAX_YEARS:
        yield (
            f"of {run.date} lies {years:.0f} years from this one: the pattern of the field may be another. The "
            "counts decide how much of it the map uses."
        )
    ratio = mean_rate(run.survey.samples) / rate_cps if rate_cps > 0 else 1.0
    if not 1 / MAX_RATE_RATIO <= ratio <= MAX_RATE_RATIO:
        yield (
            f"has {ratio:.2g} times the count rate of {'the others' if end is None else 'this one'}, more than "
            "soil moisture can change: the sensors differ, or not all tubes were counted. Give each survey a site "
            "file with its N0, or leave it out: its pattern and the change are wrong."
        )


def mean_rate(samples: mapping.Samples) -> float:
    """Mean count rate over equal exposure [counts/s]."""
    return float(samples.counts.sum() / samples.exposure_s.sum())


def run_change(soil_map: mapping.SoilMap, stamp_s: float, earlier: Sequence[EarlierRun]) -> RunChange | None:
    """The change since the latest earlier survey; ``None`` without one, or if there are too many samples.

    :param stamp_s: end of the present survey [s]
    """

    def order(run: EarlierRun) -> tuple[bool, float, str]:
        return run.survey.stamp_s > stamp_s, abs(stamp_s - run.survey.stamp_s), run.survey.name

    ordered = sorted(earlier, key=order)
    counts = accumulate((len(run.survey.samples) for run in ordered), initial=len(soil_map.samples))
    used = [run for run, count in zip(ordered, islice(counts, 1, None), strict=True) if count <= MAX_SAMPLES]
    if not used:
        return None
    surveys = [soil_map.samples, *(run.survey.samples for run in used)]
    stamps = [stamp_s, *(run.survey.stamp_s for run in used)]
    persistence = mapping.Persistence.estimate(soil_map.variogram, surveys, stamps)
    kriging = mapping.JointKriging(soil_map.variogram, surveys, persistence.matrix(stamps))
    # With a drift, the samples are as at the end of the survey: but for a common error.
    shared = None if soil_map.made_by is None else soil_map.made_by.shared
    change = mapping.field_change(kriging, soil_map.grid, 0, 1, soil_map.curve, shared=shared)
    means = {used[0].survey.name: change.mean_rate}
    places, share = mapping.mean_places(soil_map.grid)
    errors = np.zeros((len(places), 1)) if shared is None else shared(places)
    for number, run in enumerate(used[1:], 2):
        value, variance = kriging.mean(places, {0: share, number: -share})
        means[run.survey.name] = mapping.SurveysEstimate(
            value, math.sqrt(variance + float(((share @ errors) ** 2).sum()))
        )
    alone = mapping.JointKriging(soil_map.variogram, surveys[:1], np.eye(1))
    of_cell = (errors**2).sum(axis=1)
    sd, sd_alone = (math.sqrt(float(share @ (one.predict(places, 0)[1] + of_cell))) for one in (kriging, alone))
    return RunChange(used[0], change, persistence, means, sd, sd_alone, used[0].survey.stamp_s > stamp_s)


def mission_earlier(settings: MissionSettings, paths: Sequence[Path]) -> Mapping[str, tuple[EarlierRun, ...]]:
    """Finished runs as earlier surveys of each property of a simulated mission; see :func:`read_earlier_runs`."""
    from soilmoist_ros.simulation import mission_fields, mission_properties, simulated_site

    if not paths:
        return {}
    fields = mission_fields(settings)
    grid = fields[0].field.grid(settings.cell_m)
    found = {}
    for number, (one, wanted) in enumerate(zip(fields, mission_properties(settings), strict=True)):
        curve = None if number else simulated_site(one).curve  # as in the summaries of runs
        choices = mapping.FieldMapSettings(fit=settings.fit, curve=curve, footprint_radius_m=settings.footprint_m)
        found[wanted.name] = read_earlier_runs(
            paths, EarlierTarget(one.frame, grid, choices, wanted.name, number == 0, True)
        )
    return found


def simulated_runs(mapped: MappedProperty, soil_map: mapping.SoilMap) -> tuple[EarlierRun, ...]:
    """The series of surveys of a property that a mission simulated, in order of time."""
    radius_m = mapping.default_merge_radius_m(soil_map.grid, mapping.FieldMapSettings().margin_m)
    found = []
    for back, one in enumerate(mapped.series, 1):
        begin_s = one.records[0].stamp_s - one.records[0].exposure_s
        found.append(EarlierRun(one.survey(radius_m, 0.0), Path(EARLIER) / f"survey_{back}", begin_s, one.records))
    return tuple(reversed(found))
