# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The records that a finished run has left: an output folder, or a recording with its configuration."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from soilmoist_ros.foundation import InputError, LocalFrame, resource
from soilmoist_ros.mapping import load_field
from soilmoist_ros.recording import (
    RECORDS,
    SUMMARY,
    bag_of,
    configuration_of,
    read_earlier,
    read_parameters,
    read_records,
)
from soilmoist_ros.reporting.earlier.results import curve_of, read_summary
from soilmoist_ros.sensing import CountRecord, MoistureCurve, load_site

FIRST_NAMES = ("", "moisture")
"""Names of the robot's own property, which is no name to compare."""


@dataclass(frozen=True)
class RunRecords:
    """The records of a finished run.

    :param path: folder of the run, or its recording
    :param frame: plane of the records
    :param records: records in order of time, without quarantined ones
    :param property_name: name of the property that they count; empty if the run does not name it
    :param simulated: whether the counts are simulated
    :param curve: calibration of the sensor, ``None`` without one
    :param corrections: parameters of each applied correction by its name, ``None`` if the run does not say
    """

    path: Path
    frame: LocalFrame
    records: Sequence[CountRecord]
    property_name: str = ""
    simulated: bool = False
    curve: MoistureCurve | None = None
    corrections: Mapping[str, Mapping[str, Any]] | None = field(default=None)


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
    if (path / SUMMARY).is_file():
        return _of_folder(path, name, first)
    return _of_bag(path, "" if first else name)


def _of_folder(path: Path, name: str, own: bool) -> RunRecords | None:
    """Records of an output folder."""
    about = read_summary(path)
    datum = about.get("datum")
    if datum is None:
        raise InputError(
            "is not the summary of a mapped run: datum is missing", "make the run again", path / SUMMARY
        )
    frame = LocalFrame(datum["latitude_deg"], datum["longitude_deg"])
    names = [one.get("name", "") for one in about.get("properties") or ()]
    first = names[0] if names else ""
    if name in names[1:]:
        table, found = path / f"records_{name}.csv", name
    elif not own and name != first:
        return None
    else:
        _require_same(name, first, names, path)
        table, found = path / RECORDS, first
    if not table.is_file():
        raise InputError(
            f"has no {table.name}", "make the run again with this version, or give its recording", path
        )
    rows = about.get("corrections") or ()
    return RunRecords(
        path,
        frame,
        _good(read_records(table), path),
        found,
        bool(about.get("simulated")),
        curve_of(about, path) if found == first else None,
        {row["name"]: row.get("parameters") or {} for row in rows} if rows else None,
    )


def _of_bag(path: Path, name: str) -> RunRecords | None:
    """Records of a recording, in the plane of the field that its nodes had; the robot's own without a name."""
    bag = bag_of(path)
    configuration = configuration_of(bag)
    mapper = read_parameters(configuration, f"{name.strip('/')}/mapper".strip("/"))
    if name and not mapper:
        return None
    if not mapper.get("field"):
        remedy = "map it with soilmoist replay --field, and give the folder of that"
        raise InputError("does not say in which field it was recorded", remedy, path)
    site = load_site(resource("sites", str(mapper["site"]))) if mapper.get("site") else None
    return RunRecords(
        path,
        load_field(resource("fields", str(mapper["field"]))).frame,
        _good(read_earlier(bag, name), path),
        name,
        bool(mapper.get("simulated")),
        None if site is None else site.curve,
    )


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


def _require_same(name: str, first: str, names: Sequence[str], path: Path) -> None:
    """Check that a run's first property may be the one that is mapped."""
    if name in FIRST_NAMES or first in FIRST_NAMES or name == first:
        return
    raise InputError(
        f"is a run of the property {', '.join(map(repr, names))}, not of {name!r}",
        "give a run of the same property: the pattern of another one is not that of this one",
        path,
    )
