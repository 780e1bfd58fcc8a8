# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The example package of the documentation, installed by pip and used through the real ``soilmoist`` command."""

import csv
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame

ROOT = Path(__file__).resolve().parent.parent
SOILMOIST = Path(sys.executable).with_name("soilmoist")

pytestmark = [pytest.mark.process, pytest.mark.slow]


@pytest.fixture(scope="module")
def soilmoist(tmp_path_factory):
    """Runs the command where the example package is installed."""
    folder = tmp_path_factory.mktemp("plugin")
    shutil.copytree(ROOT / "docs" / "example_plugin", folder / "source")
    options = ["--quiet", "--disable-pip-version-check", "--no-deps", "--no-build-isolation", "--no-index"]
    pip = [sys.executable, "-m", "pip", "install", *options, "--target", folder / "site", folder / "source"]
    subprocess.run(pip, check=True)

    def run(*arguments):
        environment = {**os.environ, "PYTHONPATH": str(folder / "site")}
        done = subprocess.run([SOILMOIST, *map(str, arguments)], env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_a_log_is_mapped_with_its_logger_and_variogram_model(soilmoist, tmp_path):
    frame = LocalFrame(53.268, -0.5245)
    rng = np.random.default_rng(1)
    lines = ["time,neutrons,live_s,pressure_kpa,air_degc,humidity_percent,lat,lon"]
    for minute in range(40):
        east, north = 10.0 * (minute % 7), 8.0 * (minute // 7)
        latitude, longitude = frame.to_geographic((east, north))[0]
        time = f"2026-05-01T10:{minute:02d}:00Z"
        lines.append(f"{time},{rng.poisson(180)},60,101.3,15.0,60,{latitude:.7f},{longitude:.7f}")
    (tmp_path / "acme.csv").write_text("\n".join(lines) + "\n")
    chosen = ("--logger", "acme", "--model", "cauchy", "--field", "example")
    soilmoist("map", tmp_path / "acme.csv", *chosen, "--out", tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["n_records"] == 40
    assert summary["logger_format"] == "Acme neutron logger"
    assert 2.5 < summary["map"]["rate_cps"]["mean"] < 3.5
    assert summary["variogram"]["model"] == "cauchy"
    soilmoist("export", tmp_path / "out", "--to", "points")
    assert len((tmp_path / "out" / "export" / "points.txt").read_text().splitlines()) == summary["n_samples"]


def test_a_mission_is_simulated_with_its_strategy(soilmoist, tmp_path):
    settings = ("--strategy", "farthest", "--dwell", "fmi:120", "--hours", "0.5", "--cell", "4")
    soilmoist("simulate", *settings, "--out", tmp_path / "out")
    visits = list(csv.DictReader((tmp_path / "out" / "visits.csv").read_text().splitlines()))
    chosen = [visit for visit in visits if visit["reason"].startswith("farthest from what was measured")]
    assert len(visits) > len(chosen) > 2  # the first ones, before there is a map, are drawn at random
