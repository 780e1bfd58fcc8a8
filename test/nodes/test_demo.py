# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration as a user starts it: with a further property, with several robots."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio

pytest.importorskip("rclpy")
from soilmoist_ros.mapping import CovariateSource, load_field
from soilmoist_ros.nodes.demo import DemoError, DemoSettings, _require_all, write_configuration
from soilmoist_ros.nodes.process_group import ProcessGroup
from soilmoist_ros.recording import CONFIGURATION, BagReader, points, read_parameters
from soilmoist_ros.simulation import MissionSettings, PropertySettings, surrogate_field

LIMIT_S = 480.0
"""Longest wait for a demonstration that takes a minute on an idle machine [s]."""


def run_demo(out, options):
    command = [sys.executable, "-m", "soilmoist_ros.cli.main", "demo", *options.split(), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
    logs = {path.name: path.read_text(errors="replace") for path in (out / "log").glob("*.log")}
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{logs}"
    return done.stdout


def test_a_node_that_is_killed_is_named_with_the_signal_not_its_last_words(tmp_path):
    program = ("-c", "import time; print('[INFO] all is well', flush=True); time.sleep(60)")
    with ProcessGroup({}, tmp_path) as group:
        group.start("planner", tmp_path / "none.yaml", program=program)
        os.kill(group.pid("planner"), signal.SIGKILL)
        while not group.ended():
            time.sleep(0.01)
        with pytest.raises(DemoError, match=r"^planner was killed \(signal 9, Killed\)\nits log: [^\n]*$"):
            _require_all(group)


def test_the_map_of_one_robot_is_that_of_its_replay_bit_for_bit(tmp_path):
    said = run_demo(tmp_path / "run", "--field half-wet --hours 0.05 --time-factor 60")
    assert "map        equals the robot's last one, bit for bit" in said


def test_two_robots_share_maps_of_two_properties_and_keep_apart(tmp_path):
    out, names = tmp_path / "run", ("robot_1", "robot_2")
    # At 60 times the speed, a tenth of a second that a busy machine takes is six seconds and metres of a robot.
    options = "--robots 2 --field synthetic-high --property rough:2 --hours 0.15 --time-factor 20 --strategy gcb"
    said = run_demo(out, options)
    assert said.startswith("console    http://127.0.0.1:")
    assert "robot 2: " in said  # what it does at that moment; the bag says below that it counted
    # Mapper and recorder may get the records of two robots in different orders, and merge them to other samples.
    compared = re.findall(r"^map +(equals the robot's last one|differs .* by up to (\S+) of)", said, re.MULTILINE)
    assert len(compared) == 2, said
    assert all(float(largest or 0) < 0.1 for _, largest in compared), compared

    with BagReader(out / "bag") as bag:
        records = [bag.read_counts(f"/{name}/counts") for name in names]
        of_rough = [bag.read_counts(f"/{name}/rough/counts") for name in names]
        last = {message.topic: message for message in bag.messages(["/soil_map", "/rough/soil_map", "/samples"])}
        cells = {topic: points(bag.decode(message)) for topic, message in last.items()}
        health = [status for message in bag.messages(["/diagnostics"]) for status in bag.decode(message).status]
        missions = [
            (message.topic.split("/")[1], bag.decode(message))
            for message in bag.messages([f"/{name}/mission" for name in names])
        ]
    counts = [sum(one.raw_counts for one in its) for its in records]
    assert min(counts) > 0
    assert cells["/samples"]["raw_counts"].sum() > 1.2 * max(counts), "the map has the counts of both"
    assert min(map(len, of_rough)) > 15
    assert {one.stamp_s for one in records[0]} & {one.stamp_s for one in of_rough[0]}
    mapped = [np.isfinite(cells[topic]["rate"]).sum() for topic in ("/rough/soil_map", "/soil_map")]
    assert mapped[0] == mapped[1] > 1000
    assert np.isnan(cells["/rough/soil_map"]["vwc"]).all(), "it is no moisture"
    shown = {status.message for status in health if status.name.endswith("/planner: properties")}
    assert "the last stop was chosen with the map of rough" in shown
    assert read_parameters(out / "configuration", "rough/mapper")["save_dir"] == str(out / "map_rough")

    cell_m = surrogate_field("synthetic-high").field.cell_m
    now, visited = {}, set()
    for name, status in missions:
        values = {pair.key: pair.value for pair in status.values}
        now[name] = values["state"], (float(values["target_x_m"]), float(values["target_y_m"]))
        if values["state"] == "counting":
            visited.add(name)
        busy = [target for state, target in now.values() if state in ("travelling", "counting")]
        if len(busy) == 2 and "counting" in {state for state, _ in now.values()}:
            assert math.dist(*busy) >= cell_m / 2, "two robots at one stop"
    assert visited == set(names)

    about = json.loads((out / "summary.json").read_text())
    assert {"map_rough.tif", "samples_rough.geojson"} < set(about["outputs"])
    mission = about["mission"]
    assert (mission["settings"]["also"], mission["settings"]["also_weight"]) == ("rough", 2.0)
    assert mission["settings"]["robots"] == len(mission["robot_distances_m"]) == 2
    assert min(mission["robot_distances_m"]) > 5.0
    truth = surrogate_field("rough")
    with rasterio.open(out / "map_rough.tif") as raster:
        rate = raster.read(raster.descriptions.index("rate") + 1, masked=True)
    assert abs(rate.mean() - truth.rate_at(truth.field.grid().cells).mean()) < 0.5
    assert (out / "map_rough" / "map.tif").is_file(), "what its mapper has saved itself"
    header, *_, final = (out / "series.csv").read_text().splitlines()
    row = dict(zip(header.split(","), final.split(","), strict=True))
    assert float(row["also_mse"]) == pytest.approx(mission["final"]["also_mse"], rel=1e-6)
    header, *rows = (out / "visits.csv").read_text().splitlines()
    robots = [dict(zip(header.split(","), row.split(","), strict=False))["robot"] for row in rows]
    assert len(rows) == mission["final"]["samples"] >= 4
    assert set(robots) == {"1", "2"}
    report = (out / "report.html").read_text()
    assert ": Neutron rate" in report
    assert "There were 2 robots" in report


# Demo configuration ---------------------------------------------------------------------------------------------


def test_all_mappers_and_planners_know_the_covariates_and_those_of_the_field_the_earlier_runs(tmp_path):
    settings = DemoSettings(
        tmp_path,
        MissionSettings("smooth", target="decision", threshold="0.2", properties=(PropertySettings("rough"),)),
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
        assert had.get("earlier") == (None if "/" in node else [str(tmp_path / "may"), str(tmp_path / "june")])
        assert had.get("threshold") == ("0.2" if node == "planner" else None)
