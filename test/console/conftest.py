# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Modules that tests of the console share."""

import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "nodes")]


@pytest.fixture
def urgent_jobs(monkeypatch):
    """Jobs of the page do not yield to other tests: a process with niceness 10 takes minutes on busy cores."""
    from soilmoist_ros.console import plan_routes, runs

    monkeypatch.setattr(runs, "_YIELDING", ())
    monkeypatch.setattr(plan_routes, "LIMIT_S", 300.0)
