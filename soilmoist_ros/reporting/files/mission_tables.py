# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The course of a mission as CSV files."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, fields
from pathlib import Path

from soilmoist_ros.exploration import Visit
from soilmoist_ros.foundation import csv_text
from soilmoist_ros.simulation import MissionResult


def write_series(path: Path, mission: MissionResult) -> Path:
    """Write the state over time, one row per entry; return ``path``. Undefined values are empty.

    Each further property adds the columns ``mse_NAME`` and ``coverage95_NAME``.
    """
    columns = mission.columns
    return _write(path, list(columns), zip(*columns.values(), strict=True))


def write_visits(path: Path, mission: MissionResult) -> Path:
    """Write the visits in order, one column for each field of :class:`Visit`; return ``path``."""
    return _write(path, [field.name for field in fields(Visit)], map(astuple, mission.visits))


def _write(path: Path, names: Sequence[str], rows: Iterable[Sequence[object]]) -> Path:
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([_cell(*pair) for pair in zip(names, row, strict=True)] for row in rows)
    return path


def _cell(name: str, value: object) -> object:
    if not isinstance(value, float):
        return csv_text(value)
    if not math.isfinite(value):
        return ""
    # Unix time needs ten digits before the point.
    return f"{value:.13g}" if name.endswith("_stamp_s") else f"{value:.8g}"
