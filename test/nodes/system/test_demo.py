"""The demonstration as a user starts it, with a further property."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
import rasterio

pytest.importorskip("rclpy")
from soilmoist_ros.recording.bag.point_cloud import points
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.recording.run_folder import read_parameters
from soilmoist_ros.simulation.fields.catalogue import surrogate_field

LIMIT_S = 240.0
"""Longest wait for a mission that takes about 30 s on an idle machine [s]."""


def test_a_second_property_is_counted_mapped_planned_for_recorded_and_reported(tmp_path):
    out = tmp_path / "run"
    options = ["--property", "rough:2", "--hours", "0.25", "--time-factor", "60", "--strategy", "ivr"]
    command = [sys.executable, "-m", "soilmoist_ros.cli.main", "demo", *options, "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
    logs = {path.name: path.read_text(errors="replace") for path in (out / "log").glob("*.log")}
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{logs}"
    assert "rough_mapper.log" in logs
    assert done.stdout.count("map        equals the robot's last one, bit for bit") == 2

    with BagReader(out / "bag") as bag:
        first, second = bag.read_counts("/counts"), bag.read_counts("/rough/counts")
        last = {message.topic: message for message in bag.messages(["/soil_map", "/rough/soil_map"])}
        cells = {topic: points(bag.decode(message)) for topic, message in last.items()}
        said = [status for message in bag.messages(["/diagnostics"]) for status in bag.decode(message).status]
        statuses = [bag.decode(message).message for message in bag.messages(["/mission"])]
    assert len(second) > 30
    assert {one.stamp_s for one in first} & {one.stamp_s for one in second}
    assert (
        np.isfinite(cells["/rough/soil_map"]["rate"]).sum() == np.isfinite(cells["/soil_map"]["rate"]).sum() > 1000
    )
    assert np.isnan(cells["/rough/soil_map"]["vwc"]).all(), "it is no moisture"
    shown = {status.message for status in said if status.name == "/planner: properties"}
    assert "the last stop was chosen with the map of rough" in shown
    assert any("most variance less per second" in text and "of the maps'" in text for text in statuses)
    assert read_parameters(out / "configuration", "rough/mapper")["save_dir"] == str(out / "map_rough")

    about = json.loads((out / "summary.json").read_text())
    assert {"map_rough.tif", "samples_rough.geojson"} < set(about["outputs"])
    assert (about["mission"]["settings"]["also"], about["mission"]["settings"]["also_weight"]) == ("rough", 2.0)
    assert about["mission"]["also"]["n_records"] == len(second)
    truth = surrogate_field("rough")
    with rasterio.open(out / "map_rough.tif") as raster:
        rate = raster.read(1, masked=True)
    assert abs(rate.mean() - truth.rate_at(truth.field.grid().cells).mean()) < 0.5
    assert (out / "map_rough" / "map.tif").is_file(), "what its mapper has saved itself"
    header, *_, final = (out / "series.csv").read_text().splitlines()
    row = dict(zip(header.split(","), final.split(","), strict=True))
    assert float(row["also_mse"]) == pytest.approx(about["mission"]["final"]["also_mse"], rel=1e-6)
    assert 'id="properties"' in (out / "report.html").read_text()
