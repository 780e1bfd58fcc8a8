# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.recording.stored_records import write_records
from soilmoist_ros.sensing.records import CountRecord

FRAME = LocalFrame(53.268, -0.5245)
MAY_S, JUNE_S = 1.7777e9, 1.7804e9


def records(seed: int, end_s: float, shift_m: float = 0.0) -> list[CountRecord]:
    rng = np.random.default_rng(seed)
    places = rng.uniform((0, 0), (60, 50), (30, 2)) + shift_m
    return [
        CountRecord(end_s - 10.0 * (29 - i), x, y, 0.0, int(rng.poisson(40)), 10.0, 9.5)
        for i, (x, y) in enumerate(places.tolist())
    ]


def run_folder(path: Path, its: list[CountRecord], frame: LocalFrame = FRAME, **more: object) -> Path:
    path.mkdir(parents=True, exist_ok=True)
    about = {
        "datum": {"latitude_deg": frame.latitude_deg, "longitude_deg": frame.longitude_deg}, "simulated": False,
        "properties": [{"name": ""}], **more,
    }  # fmt: skip
    (path / "summary.json").write_text(json.dumps(about))
    write_records(path / "records.csv", its)
    return path
