# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Inputs that once broke a reader, and some changed ones; ``scripts/fuzz`` looks for more."""

import random
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parent))
import fuzz_targets as fuzz

FOUND = sorted(Path(__file__).parent.glob("found/**/*.bin"))
TRIES = 8
ROS = ("model", "status")
"""Targets that need ROS."""


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # by which GDAL says what it repairs
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("path", FOUND, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_what_broke_a_reader_is_refused_now(path):
    if path.parent.name in ROS:
        pytest.importorskip("rclpy")
    fuzz.TARGETS[path.parent.name](path.read_bytes())


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # by which GDAL says what it repairs
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("name", fuzz.TARGETS)
@pytest.mark.slow
def test_changed_files_are_read_or_refused(name):
    if name in ROS:
        pytest.importorskip("rclpy")
    target, rng = fuzz.TARGETS[name], random.Random(name)
    seeds = target.seeds()
    assert seeds
    for number, seed in enumerate(seeds):
        assert target(seed), f"seed {number} is refused: its changes would be, too, for the same reason"
    for _ in range(TRIES):
        target(fuzz.mutated(rng.choice(seeds), rng))


def test_a_fault_of_a_reader_is_seen(monkeypatch):
    def breaks(data):
        raise KeyError("missing")

    def hangs(data):
        while True:
            pass

    with pytest.raises(KeyError):
        fuzz.Target(breaks, list)(b"")
    monkeypatch.setattr(fuzz, "LIMIT_S", 0.2)
    with pytest.raises(TimeoutError):
        fuzz.Target(hangs, list)(b"")
