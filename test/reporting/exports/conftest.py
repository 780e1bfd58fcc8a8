# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.pipeline.run import MapRun
from soilmoist_ros.recording import write_records
from soilmoist_ros.reporting import RunSource, open_run, open_source, summary, write_geotiff
from soilmoist_ros.reporting.outputs import _tags
from soilmoist_ros.reporting.text_files import write_json, write_samples, write_visits
from soilmoist_ros.sensing.records import CountRecord


@dataclass(frozen=True)
class Exported:
    """A run folder, the run in it, and the folder opened for exports."""

    folder: Path
    run: MapRun
    source: RunSource


@pytest.fixture(scope="session")
def exported(make_run, uncalibrated, tmp_path_factory):
    """Moisture, and a second property with a count rate only; one record in quarantine, one stop."""
    folder = tmp_path_factory.mktemp("run")
    bad = CountRecord(1.7e9 + 9000, 3.0, 4.0, 80.0, 99999, 10.0, 10.0, quarantine="impossible_count")
    other = make_run(soil_map=uncalibrated, name="salt", label="Salt")
    run = make_run(others=(other,), quarantined=[bad])
    run = replace(run, track=run.track[:-1])
    visit = Visit("r1c2", 1.0, 2.0, 10.0, 60.0, 300, "largest variance", arrival_stamp_s=1.7e9)
    for one, end in ((run, ""), (other, "_salt")):
        write_geotiff(folder / f"map{end}.tif", one.soil_map, one.frame, tags=_tags(one))
        write_samples(folder / f"samples{end}.geojson", one)
        write_records(folder / f"records{end}.csv", one.all_records)
    write_visits(folder / "visits.csv", SimpleNamespace(visits=[visit]))
    write_json(folder / "summary.json", summary(run, "EPSG:32630"))
    return Exported(folder, run, open_source(open_run(folder)))
