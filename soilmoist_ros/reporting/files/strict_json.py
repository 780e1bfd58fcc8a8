# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Standard JSON: no NaN, no infinity, plain numbers, UTF-8."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def jsonable(value: Any) -> Any:
    """The value in plain types; NaN and infinity become ``None``."""
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.bool_ | np.integer):
        return value.item()
    if isinstance(value, Mapping):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple | set | frozenset):
        return [jsonable(item) for item in value]
    return str(value)


def dumps(value: Any, indent: int | None = None) -> str:
    """Strict JSON text."""
    return json.dumps(jsonable(value), allow_nan=False, ensure_ascii=False, indent=indent)


def write_json(path: Path, value: Any, indent: int | None = 2) -> Path:
    """Write strict JSON that ends in a line feed."""
    path.write_text(dumps(value, indent) + "\n", encoding="utf-8")
    return path
