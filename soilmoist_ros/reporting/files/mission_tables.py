"""The course of a mission as CSV files."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, fields
from pathlib import Path

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.simulation.mission.result import MissionResult


def write_series(path: Path, mission: MissionResult) -> Path:
    """Write the state over time, one row per entry; returns ``path``. What is not defined is empty.

    Each further property adds the columns ``mse_NAME`` and ``coverage95_NAME``.
    """
    columns = mission.columns
    return _write(path, list(columns), zip(*columns.values(), strict=True))


def write_visits(path: Path, mission: MissionResult) -> Path:
    """Write the visits in order, one column for each field of :class:`Visit`; returns ``path``."""
    return _write(path, [field.name for field in fields(Visit)], map(astuple, mission.visits))


def _write(path: Path, names: Sequence[str], rows: Iterable[Sequence[object]]) -> Path:
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([_cell(value) for value in row] for row in rows)
    return path


def _cell(value: object) -> object:
    if isinstance(value, float):
        return f"{value:.8g}" if math.isfinite(value) else ""
    return value
