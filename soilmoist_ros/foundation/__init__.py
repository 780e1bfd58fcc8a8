# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Errors with a remedy, configuration files, geodesy and health; imports no other folder of the package."""

from __future__ import annotations

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.lazy import load_on_use

if TYPE_CHECKING:
    from soilmoist_ros.foundation.errors import IllConditionedError, InputError, Mistake, SoilmoistError
    from soilmoist_ros.foundation.geodesy import LocalFrame
    from soilmoist_ros.foundation.health import Health, Level
    from soilmoist_ros.foundation.registry import Registry
    from soilmoist_ros.foundation.sections import load_model

__all__ = [
    "DAY_S",
    "Health",
    "IllConditionedError",
    "InputError",
    "Level",
    "LocalFrame",
    "Mistake",
    "Registry",
    "SoilmoistError",
    "load_model",
]

DAY_S = 86_400.0
"""A day [s]."""

__getattr__ = load_on_use(__name__, __file__)
