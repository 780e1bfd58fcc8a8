# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""An export: places and rates of the samples as plain text, one line each."""

from pathlib import Path

import numpy as np

from soilmoist_ros.reporting import Export, ExportSettings, RunSource


def write_points(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``points.txt`` for each property: longitude, latitude and rate."""
    written = []
    for one in source.properties:
        path = folder / f"points{one.suffix}.txt"
        columns = [one.samples[name] for name in ("longitude_deg", "latitude_deg", "rate_cps")]
        np.savetxt(path, np.column_stack(columns), fmt=("%.7f", "%.7f", "%.4f"))
        written.append(path)
    return written


POINTS = Export(write_points, "points", "samples as plain text", ".txt")
