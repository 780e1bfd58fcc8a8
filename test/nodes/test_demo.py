# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration as a user starts it: with a further property, with several robots."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio

pytest.importorskip("rclpy")
from soilmoist_ros.mapping.covariates import CovariateSource
from soilmoist_ros.mapping.field import load_field
from soilmoist_ros.nodes.demo import DemoSettings, write_configuration
from soilmoist_ros.recording.bag.messages import points
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.recording.run_folder import CONFIGURATION, read_parameters
from soilmoist_ros.simulation import MissionSettings, PropertySettings, surrogate_field

LIMIT_S = 480.0
"""Longest wait for a demonstration that takes a minute on an idle machine [s]."""


def run_demo(out, options):
    """Run a demonstration; returns what it prints."""
    command = [sys.executable, "-m", "soilmoist_ros.cli.main", "demo", *options.split(), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
    logs = {path.name: path.read_text(errors="replace") for path in (out / "log").glob("*.log")}
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{logs}"
    return done.stdout


def test_a_second_property_is_counted_mapped_planned_for_recorded_and_reported(tmp_path):
    out = tmp_path / "run"
    options = "--field synthetic-high --property rough:2 --hours 0.15 --time-factor 60 --strategy ivr"
    said = run_demo(out, options)
    assert said.startswith("console    http://127.0.0.1:")
    assert said.count("map        equals the robot's last one, bit for bit") == 2

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
        rate = raster.read(raster.descriptions.index("rate") + 1, masked=True)
    assert abs(rate.mean() - truth.rate_at(truth.field.grid().cells).mean()) < 0.5
    assert (out / "map_rough" / "map.tif").is_file(), "what its mapper has saved itself"
    header, *_, final = (out / "series.csv").read_text().splitlines()
    row = dict(zip(header.split(","), final.split(","), strict=True))
    assert float(row["also_mse"]) == pytest.approx(about["mission"]["final"]["also_mse"], rel=1e-6)
    assert ": Neutron rate" in (out / "report.html").read_text()


def test_several_robots_share_a_map_and_keep_apart(tmp_path):
    out = tmp_path / "run"
    said = run_demo(out, "--robots 2 --hours 0.12 --strategy ivr --field half-wet --no-console")
    assert "console" not in said
    assert "robot 2: counting" in said
    names = ("robot_1", "robot_2")
    with BagReader(out / "bag") as bag:
        records = [bag.read_counts(f"/{name}/counts") for name in names]
        *_, last = bag.messages(["/samples"])
        cloud = bag.decode(last)
        doing = [
            (message.topic.split("/")[1], {pair.key: pair.value for pair in bag.decode(message).values})
            for message in bag.messages([f"/{name}/mission" for name in names])
        ]
    counts = [sum(one.raw_counts for one in its) for its in records]
    assert min(counts) > 0
    assert points(cloud)["raw_counts"].sum() > 1.2 * max(counts), "the map has the counts of both"

    cell_m = surrogate_field("half-wet").field.cell_m
    now = {}
    visited = set()
    for name, values in doing:
        now[name] = values["state"], (float(values["target_x_m"]), float(values["target_y_m"]))
        if values["state"] == "counting":
            visited.add((name, values["target"]))
        busy = [target for state, target in now.values() if state in ("travelling", "counting")]
        if len(busy) == 2 and "counting" in {state for state, _ in now.values()}:
            assert math.dist(*busy) >= cell_m / 2, "two robots at one stop"
    assert {name for name, _ in visited} == set(names)

    about = json.loads((out / "summary.json").read_text())["mission"]
    assert about["settings"]["robots"] == 2
    assert len(about["robot_distances_m"]) == 2
    assert min(about["robot_distances_m"]) > 5.0
    header, *rows = (out / "visits.csv").read_text().splitlines()
    robots = [dict(zip(header.split(","), row.split(","), strict=False))["robot"] for row in rows]
    assert len(rows) == about["final"]["samples"] >= 4
    assert set(robots) == {"1", "2"}
    assert "There were 2 robots" in (out / "report.html").read_text()


# Demo configuration ---------------------------------------------------------------------------------------------


def test_all_mappers_and_planners_know_the_covariates_and_those_of_the_field_the_earlier_runs(tmp_path):
    settings = DemoSettings(
        tmp_path,
        MissionSettings(field="smooth", properties=(PropertySettings("rough"),)),
        covariates=(CovariateSource(tmp_path / "relief.tif", "slope"),),
        earlier=(tmp_path / "may", tmp_path / "june"),
    )
    field = surrogate_field("smooth")
    of_field = CovariateSource(tmp_path / "image.tif", "2", name="ndvi")
    field = replace(field, field=replace(field.field, covariates=(of_field,)))
    write_configuration(settings, field, tmp_path)
    for node in ("mapper", "planner", "rough/mapper"):
        had = read_parameters(tmp_path / CONFIGURATION, node)
        assert had["covariates"] == [f"{tmp_path / 'relief.tif'}:slope"]
        assert load_field(Path(had["field"])).covariates == (of_field,)
        earlier = None if "/" in node else [str(tmp_path / "may"), str(tmp_path / "june")]
        assert had.get("earlier") == earlier
