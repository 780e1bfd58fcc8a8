# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A field with zones of one dose, without a run."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
from affine import Affine
from shapely import Polygon, box

from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.reporting.dose import DoseSettings, DoseZone
from soilmoist_ros.reporting.exports.irrigation import Plan
from soilmoist_ros.reporting.exports.source import ExportedProperty, RunSource

HOLE = [(-12, -12), (12, -12), (12, 9), (-12, 9)]
OUTLINE = Polygon([(-60, -45), (60, -45), (60, 30), (15, 45), (-60, 45)], [HOLE])
"""No symmetry: a map that is mirrored or turned does not fit."""
PARTS = (box(-60, -45, -20, 45), box(-20, -15, 60, 45), box(-20, -45, 60, -15))
"""West, north-east and south-east."""


def irrigated(doses=(0.0, 10.0, 15.0), latitude=53.27, longitude=-0.52, cell_m=2.0, outline=OUTLINE, **summary):
    """The source of a run, and its plan; one dose for each of :data:`PARTS`, rising."""
    frame = LocalFrame(latitude, longitude)
    bands = {"rate": np.ones((90, 120)), "vwc": np.full((90, 120), 0.2)}
    transform = Affine(cell_m, 0, -60, 0, -cell_m, 45)
    tags = {"SOILMOIST_CALIBRATION": "own"}
    one = ExportedProperty("", "Moisture", bands, transform, frame.crs, tags, frame, {}, {})
    about = {"field": "West", "site": "Riseholme", "version": "0.1.0", **summary}
    run = SimpleNamespace(summary=about, folder=Path("run"))
    source = RunSource(run, [one], frame, outline, [Polygon(HOLE)], [])
    used = sorted(set(doses))
    zones = [
        DoseZone(
            outline.intersection(part), used.index(gross) + 1, gross, 0.8 * gross, 0.5 * gross, 1.2 * gross,
            0.9 if gross else 0.1, 0.7, 0.9 if gross else 0.0,
        )
        for part, gross in zip(PARTS, doses, strict=True)
    ]  # fmt: skip
    settings = DoseSettings(wilting_point=0.1, field_capacity=0.3, max_dose_mm=100)
    return source, Plan(settings, zones, 0.55, "", one, "2026-05-03")
