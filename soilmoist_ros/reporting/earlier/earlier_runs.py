# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Finished runs as earlier surveys of the field that is being mapped (``--earlier RUN``)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from soilmoist_ros.foundation import InputError, LocalFrame, Mistake, distance_text
from soilmoist_ros.mapping import (
    EarlierSurvey,
    FieldGrid,
    FieldMapSettings,
    Samples,
    default_merge_radius_m,
    possible_moisture,
    samples_at_end,
    survey_samples,
)
from soilmoist_ros.reporting.earlier.run_records import RunRecords, find_runs, read_run
from soilmoist_ros.reporting.survey_times import EARLIEST_STAMP_S
from soilmoist_ros.sensing import CountRecord, MoistureCurve

SAME_RECORDS = 0.5
"""Share of equal stamps and counts from which two runs are one survey; by chance it is a twentieth."""
SAME_SENSOR = 0.01
"""Relative difference of their rates over equal soil up to which two sensors are one."""


@dataclass(frozen=True, eq=False)
class Target:
    """What earlier surveys must fit: the map that is being made.

    :param frame: plane of the field
    :param grid: the field
    :param settings: of its map
    :param name: name of the property; may be empty for the robot's own
    :param first: whether it is the robot's own; runs without a further property are left out
    :param simulated: whether its counts are simulated, ``None`` if either may be
    """

    frame: LocalFrame
    grid: FieldGrid
    settings: FieldMapSettings
    name: str = ""
    first: bool = True
    simulated: bool | None = None


@dataclass(frozen=True, eq=False)
class EarlierRun:
    """An earlier survey, and where it comes from.

    :param survey: its samples in the present field
    :param path: the run
    :param begin_s: begin of its first record [s since 1970-01-01 UTC]
    :param records: records in the present field
    :param outside: records that lie outside and are left out
    :param scale: rate of its sensor relative to that of the present one over equal soil, by their calibrations;
        divided out
    :param remarks: what the user should know, in sentences
    :param corrections: parameters of each applied correction by its name, ``None`` if unknown
    """

    survey: EarlierSurvey
    path: Path
    begin_s: float
    records: Sequence[CountRecord]
    outside: int = 0
    scale: float = 1.0
    remarks: tuple[str, ...] = ()
    corrections: Mapping[str, Mapping[str, Any]] | None = None

    @property
    def date(self) -> str:
        """Day of its end; empty if its clock has no date."""
        return date_text(self.survey.stamp_s)


def date_text(stamp_s: float) -> str:
    """Day of a time stamp as YYYY-MM-DD; empty for a clock without a date."""
    return f"{datetime.fromtimestamp(stamp_s, UTC):%Y-%m-%d}" if stamp_s >= EARLIEST_STAMP_S else ""


def read_earlier_runs(paths: Sequence[Path | str], target: Target) -> tuple[EarlierRun, ...]:
    """Earlier surveys of a field from finished runs, in order of time.

    Counts and effective exposures are taken, not the maps; records are merged as those of the present survey, and
    moved to its plane if the datum differs. Where both sensors are calibrated, the exposures are scaled by the
    ratio of the rates of both over the soil of the earlier survey: ``counts ~ Poisson(scale * rate * exposure)``,
    so the rates are those that the present sensor would count, and the counts stay Poisson.

    :param paths: output folders, recordings, or folders of such
    :param target: what they must fit
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
    for number, run in enumerate(found):
        for other in found[:number]:
            if same_survey(run.records, other.records):
                mistakes.append(Mistake(f"is the same survey as {other.path}", "give it once", run.path))
    if mistakes:
        raise InputError(mistakes)
    return tuple(sorted(_named(found), key=lambda run: run.survey.stamp_s))


def require_other(runs: Sequence[EarlierRun], records: Sequence[CountRecord]) -> None:
    """Check that no earlier survey is the present one: its counts would be used twice.

    :param records: records of the present survey
    :raises InputError: if one is
    """
    for run in runs:
        if same_survey(run.records, records):
            message = "is the survey that is being mapped: its counts would be used twice"
            raise InputError(message, "leave it out", run.path)


def with_corrections(run: EarlierRun, applied: Mapping[str, Mapping[str, Any]]) -> EarlierRun:
    """A run with a remark if its counts were corrected otherwise than those of the present survey.

    :param applied: parameters of each correction of the present survey by its name
    """
    if run.corrections is None:
        return run
    names = sorted({*applied, *run.corrections})
    other = [name for name in names if dict(applied.get(name, {})) != dict(run.corrections.get(name, {}))]
    if not other:
        return run
    remark = f"Corrected otherwise: {', '.join(other)}. Its mean is free, but its pattern may differ a little."
    return replace(run, remarks=(*run.remarks, remark))


def same_survey(first: Sequence[CountRecord], second: Sequence[CountRecord]) -> bool:
    """Whether most records of the shorter survey are in the other one: stamp, counts and exposure."""
    keys = [
        Counter((one.stamp_s, one.raw_counts, one.exposure_s) for one in records) for records in (first, second)
    ]
    shorter = min(len(first), len(second))
    return shorter > 0 and (keys[0] & keys[1]).total() > SAME_RECORDS * shorter


def _earlier(run: RunRecords, target: Target) -> EarlierRun:
    """A run as an earlier survey.

    :raises InputError: if it does not fit
    """
    if target.simulated is not None and run.simulated != target.simulated:
        kinds = ("measured", "simulated")
        message = f"its counts are {kinds[run.simulated]}, those of this survey {kinds[target.simulated]}"
        raise InputError(message, "give runs of the same kind", run.path)
    records, outside = _inside(run, target)
    remarks = []
    if outside:
        remarks.append(f"{outside} of {len(run.records)} records lie outside the field and are left out.")
    radius_m = target.settings.merge_radius_m
    if radius_m is None:
        radius_m = default_merge_radius_m(target.grid, target.settings.margin_m)
    sizes = radius_m, target.settings.sample_radius_m
    if target.settings.drift_model == "off":
        samples = survey_samples(records, *sizes)
    else:
        samples = samples_at_end(records, *sizes, target.grid.extent_m)
    scale = _scale(run.curve, target.settings.curve, samples)
    if scale != 1.0:
        samples = replace(samples, exposure_s=samples.exposure_s * scale)
        remarks.append(
            f"By the calibrations, its sensor counts {scale:.3g} times as much over equal soil; its exposures are "
            "scaled. If it is the same sensor, map that survey again with the present site file."
        )
    stamp_s = records[-1].stamp_s
    name = run.path.name or str(run.path)
    survey = EarlierSurvey(name, stamp_s, samples)
    begin_s = records[0].stamp_s - records[0].exposure_s
    return EarlierRun(survey, run.path, begin_s, records, outside, scale, tuple(remarks), run.corrections)


def _scale(its: MoistureCurve | None, curve: MoistureCurve | None, samples: Samples) -> float:
    """Rate of a survey's sensor relative to that of the present one over the survey's mean moisture; 1 if unknown.

    N0 alone does not compare sensors: it depends on the curve, and on the water terms of the soil.
    """
    if its is None or curve is None:
        return 1.0
    vwc = possible_moisture(its, samples.counts.sum() / samples.exposure_s.sum())
    scale = float(its.rate_cps(vwc) / curve.rate_cps(vwc))
    return 1.0 if abs(scale - 1) <= SAME_SENSOR else scale


def _inside(run: RunRecords, target: Target) -> tuple[list[CountRecord], int]:
    """Records in the field and its margin, in its plane, and the number of the others.

    :raises InputError: if there is none
    """
    import shapely

    xy = np.array([(record.x_m, record.y_m) for record in run.records])
    moved = run.frame != target.frame
    if moved:
        xy = target.frame.to_local(*run.frame.to_geographic(xy).T)
    area = shapely.union_all([shapely.Polygon(ring) for ring in target.grid.polygons])
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
    """Runs with names that differ: of equal ones, each gets the folder above it."""
    counts = Counter(run.survey.name for run in runs)
    named = []
    for number, run in enumerate(runs, 1):
        name = run.survey.name
        if counts[name] > 1:
            name = f"{run.path.absolute().parent.name}/{name}"
            if sum(name == f"{one.path.absolute().parent.name}/{one.survey.name}" for one in runs) > 1:
                name = f"{name} ({number})"
        named.append(replace(run, survey=replace(run.survey, name=name)))
    return named
