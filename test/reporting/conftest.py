# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import dataclasses
from collections.abc import Callable
from datetime import datetime
from typing import Any

import numpy as np
import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping import FieldGrid, Samples, SoilMap, Variogram, make_soil_map
from soilmoist_ros.pipeline.run import CalibrationInfo, CorrectionRow, InputFile, LossRow, MapRun, Note, NoteCode
from soilmoist_ros.reporting import SeasonSettings, make_season, write_mission
from soilmoist_ros.sensing import CalibrationCurve, CountRecord, MoistureCurve, SensedSoil
from soilmoist_ros.sensing.records import NAN
from soilmoist_ros.simulation import MissionSettings, simulate_mission

CURVE = CalibrationCurve(7.0, 1.4, lattice_water=0.02, n0_sd_cps=0.1)
OUTLINE = [(-20.0, -15.0), (20.0, -15.0), (20.0, 10.0), (5.0, 15.0), (-20.0, 15.0)]
HOLE = [(-4.0, -4.0), (4.0, -4.0), (4.0, 3.0), (-4.0, 3.0)]


def soil_map(curve: MoistureCurve | None = CURVE, n: int = 12, **grid: Any) -> SoilMap:
    rng = np.random.default_rng(5)
    xy = np.column_stack([rng.uniform(-19, 19, n), rng.uniform(-14, 9, n)])
    exposure = rng.uniform(200, 400, n)
    counts = rng.poisson(np.where(xy[:, 0] > 0, 5.0, 4.2) * exposure)
    field = FieldGrid.from_polygon(**{"vertices": OUTLINE, "cell_m": 2.0, "holes": [HOLE], **grid})
    return make_soil_map(Samples(xy, counts, exposure), field, Variogram("matern32", 0.01, 12.0, 0.2), curve)


def track(soil: SoilMap) -> list[CountRecord]:
    records = [
        CountRecord(1.7e9 + 300 * i, x, y, 80.0, int(z), t * 1.02, t, 1.01, 1.0, 1.02 / 1.01)
        for i, ((x, y), z, t) in enumerate(
            zip(soil.samples.xy.tolist(), soil.samples.counts, soil.samples.exposure_s.tolist(), strict=True)
        )
    ]
    return [*records, dataclasses.replace(records[-1], stamp_s=1.77e9, x_m=NAN, y_m=NAN)]


@pytest.fixture(scope="session")
def the_map() -> SoilMap:
    return soil_map()


@pytest.fixture(scope="session")
def make_run(the_map: SoilMap) -> Callable[..., MapRun]:
    def make(**changes: Any) -> MapRun:
        soil = changes.pop("soil_map", the_map)
        values: dict[str, Any] = {
            "soil_map": soil, "frame": LocalFrame(53.27, -0.52),
            "created_utc": datetime.fromisoformat("2026-05-03T14:00:00+02:00"), "track": track(soil),
            "site": "Riseholme", "field_name": "West", "inputs": [InputFile("run.KSU", 13, 2048, "ab" * 32)],
            "logger_format": "hydroinnova_rover",
            "corrections": [CorrectionRow("air pressure", "f = exp(b (P - P0))", {"P0 [hPa]": 1013.25}, 1.01)],
            "losses": [
                LossRow("no position", 3, "run.KSU:17: no fix", "lost", "wait for a fix"),
                LossRow("no humidity", 4, "run.KSU:9: empty", "kept"),
            ],
            "notes": [Note(NoteCode.NOT_MAPPED, "salt is not mapped")],
            "calibration": CalibrationInfo(CURVE.n0_cps, CURVE.bulk_density_gcm3, 0.1, 0.02, source="6 cores"),
            "version": "0.1.0", "sensed": SensedSoil((19.2, 16.1, 24.3), (10.0, 10.0, 10.0)),
            "settings": {"merge_radius_m": 2.0, "nothing": None, "bad": float("nan")},
        }  # fmt: skip
        return MapRun(**{**values, **changes})

    return make


@pytest.fixture(scope="session")
def uncalibrated() -> SoilMap:
    return soil_map(curve=None)


@pytest.fixture(scope="session")
def steep() -> SoilMap:
    """A map whose rate is partly below the calibration curve."""
    return soil_map(curve=CalibrationCurve(12.2, 1.4))


@pytest.fixture(scope="session")
def map_of() -> Callable[..., SoilMap]:
    return soil_map


@pytest.fixture(scope="session")
def runs(tmp_path_factory):
    """The folder of a mission with two earlier surveys in it."""
    folder = tmp_path_factory.mktemp("season") / "run"
    settings = MissionSettings(
        field="synthetic-low", hours=0.15, cell_m=6.0, strategy="random", earlier_surveys=2, persistence=0.95
    )
    write_mission(folder, simulate_mission(settings))
    return folder


@pytest.fixture(scope="session")
def season(runs):
    return make_season([runs, runs / "earlier"], SeasonSettings())
