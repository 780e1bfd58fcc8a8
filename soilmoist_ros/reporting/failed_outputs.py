# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The output folder of a run without a map: report, summary and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from soilmoist_ros.foundation import __version__
from soilmoist_ros.pipeline import FailedRun, NoteCode, track_xy
from soilmoist_ros.recording import RECORDS, SUMMARY, write_records
from soilmoist_ros.reporting.files.mission_tables import write_series, write_visits
from soilmoist_ros.reporting.files.strict_json import jsonable, write_json
from soilmoist_ros.reporting.files.summary import SCHEMA, mission_summary, utc_text
from soilmoist_ros.reporting.output_folder import MISSION_NAMES, replaced_together, writable
from soilmoist_ros.reporting.page.failed import render_failed


def write_failed(folder: Path, failed: FailedRun) -> list[Path]:
    """Write ``summary.json``, ``report.html``, ``records.csv``; a mission adds ``series.csv``, ``visits.csv``.

    Without the extra ``reports`` there is no ``report.html``; a warning says so.
    Results of an earlier run in the folder are removed: they would pass for those of this one.

    :param folder: output folder; made if missing
    :returns: the paths, in the order above
    :raises InputError: if the folder cannot be written
    """
    names = writable((SUMMARY, "report.html", RECORDS, *(MISSION_NAMES if failed.mission is not None else ())))
    with replaced_together(folder, names) as workshop:
        if "report.html" in names:
            (workshop / "report.html").write_text(render_failed(failed), encoding="utf-8")
        write_records(workshop / RECORDS, failed.track)
        if failed.mission is not None:
            write_series(workshop / "series.csv", failed.mission)
            write_visits(workshop / "visits.csv", failed.mission)
        write_json(workshop / SUMMARY, failed_summary(failed, names))
    return [folder / name for name in names]


def failed_summary(failed: FailedRun, outputs: Sequence[str] = ()) -> dict[str, Any]:
    """The run as plain JSON values: the known keys of :func:`summary`; ``map`` is ``None``."""
    content = {
        "schema": SCHEMA,
        "software": "soilmoist_ros",
        "version": __version__,
        "created_utc": failed.created,
        "simulated": failed.simulated,
        "title": failed.title,
        "site": failed.site,
        "field": failed.field_name,
        "survey_start_utc": utc_text(failed.survey_start_utc),
        "survey_end_utc": utc_text(failed.survey_end_utc),
        "survey_duration_s": failed.survey_duration_s,
        "inputs": [asdict(item) for item in failed.inputs],
        "n_records": len(failed.good),
        "n_placed_records": len(track_xy(failed.good)),
        "n_lost": {row.kind: row.count for row in failed.losses if row.consequence == "lost"},
        "n_quarantined": dict(failed.quarantined),
        "raw_counts": sum(record.raw_counts for record in failed.good),
        "exposure_s": float(sum(record.exposure_s for record in failed.good)),
        "distance_m": failed.travelled_m,
        "map": None,
        "mission": None if failed.mission is None else mission_summary(failed.mission),
        "failure": {
            "why": failed.why,
            "what_to_do": list(failed.todo),
            "troubles": [asdict(trouble) for trouble in failed.troubles],
        },
        "warnings": [failed.why],
        "warning_codes": [NoteCode.NO_MAP],
        "settings": dict(failed.settings),
        "outputs": list(outputs),
    }
    return dict(jsonable(content))
