# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Inputs that once broke a reader, and some changed ones; ``scripts/fuzz`` looks for more."""

import importlib
import random
import sys
from pathlib import Path

import pytest

FOUND = Path(__file__).parent / "found"
TRIES = 8


@pytest.fixture(scope="module")
def fuzz():
    sys.path.insert(0, str(Path(__file__).parent))
    try:
        return importlib.import_module("fuzz_targets")
    finally:
        sys.path.pop(0)


ROS = ("model", "status")
"""Targets that need ROS."""
NAMES = (
    "log", "live", "nmea", "field", "geojson", "site", "scenario", "campaign", "truth", "truth_points",
    "truth_grid", "truth_raster", "logger_format", "bag", "plain_bag", "metadata", "replay",
    "journal", "snapshot", "summary", "samples", "series", "visits", "map", "stored_mission", "records", "cores",
    "monitor", "raster", "vectors",
    "topological_map", "mission", "mission_events", "request", "drawn_geojson",
    "drawn_field", "drawn_walk", *ROS,
)  # fmt: skip


def test_every_target_is_tried(fuzz):
    assert tuple(fuzz.TARGETS) == NAMES


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # by which GDAL says what it repairs
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("path", sorted(FOUND.rglob("*.bin")), ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_what_broke_a_reader_is_refused_now(fuzz, path):
    if path.parent.name in ROS:
        pytest.importorskip("rclpy")
    fuzz.TARGETS[path.parent.name](path.read_bytes())


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # by which GDAL says what it repairs
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.slow
def test_changed_files_are_read_or_refused(fuzz, name):
    if name in ROS:
        pytest.importorskip("rclpy")
    target, rng = fuzz.TARGETS[name], random.Random(name)
    seeds = target.seeds()
    assert seeds
    for number, seed in enumerate(seeds):
        assert target(seed), f"seed {number} is refused: its changes would be, too, for the same reason"
    for _ in range(TRIES):
        target(fuzz.mutated(rng.choice(seeds), rng))


def test_a_fault_of_a_reader_is_seen(fuzz):
    def breaks(data):
        raise KeyError("missing")

    def hangs(data):
        while True:
            pass

    with pytest.raises(KeyError):
        fuzz.Target(breaks, list)(b"")
    fuzz.LIMIT_S = 0.2
    try:
        with pytest.raises(TimeoutError):
            fuzz.Target(hangs, list)(b"")
    finally:
        fuzz.LIMIT_S = 20.0
