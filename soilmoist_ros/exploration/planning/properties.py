# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Properties of a field, and the normalised kriging variance that a planner lowers for all of them.

Each property p has its own counts and its own map. The planner lowers::

    sum_p w_p IV_p / V_p,    V_p = sum_g omega_g (1 - mean correlation between the cells) sill_p

IV_p is the integrated variance of the smooth rate. V_p is its value when only the mean over the field is known
(the dispersion variance, Chiles & Delfiner 2012, Geostatistics, section 2.8). IV_p / V_p has no unit. V_p is not
the sill: the data of a field with a trend determine only the ratio of sill and range well.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.planning.decision import Thresholds
from soilmoist_ros.foundation import InputError, squared_distances
from soilmoist_ros.mapping import FieldMap, Variogram
from soilmoist_ros.sensing import CountRecord, MoistureCurve

Array = NDArray[np.float64]

_WORD: Final = "[A-Za-z_][A-Za-z0-9_]*"
_NAMESPACE: Final = re.compile(rf"/?{_WORD}(/{_WORD})*/*")


@dataclass(eq=False)
class Property:
    """A mapped property of the field, as the planner sees it now.

    :param curve: calibration, to lower the variance of the moisture map instead of the rate map
    """

    field_map: FieldMap  # its map; all properties have the same grid
    weight: float = 1.0  # weight of its normalised kriging variance, relative to the other properties; 0: ignored
    factor: float = 1.0  # product of the correction factors of its sensor now, ``raw rate = rate / factor`` [-]
    curve: MoistureCurve | None = None
    name: str = ""  # namespace of its mapper, empty for the mapper of the robot
    thresholds: Thresholds | None = None  # those of the decision that its map is for, if it is for one


def correction_factor(record: CountRecord) -> float:
    """Product of the correction factors of a record: exposure divided by effective exposure [-].

    >>> correction_factor(CountRecord(0.0, 0.0, 0.0, 0.0, 40, exposure_s=10.0, effective_exposure_s=8.0))
    1.25
    """
    return record.exposure_s / record.effective_exposure_s


def variation(variogram: Variogram, cells_xy: Array) -> float:
    """Variance of the smooth rate over cells, as expected from a variogram [(counts/s)^2]."""
    scaled = variogram.scaled(cells_xy)
    correlation = variogram.correlation_of_square(squared_distances(scaled, scaled))
    return max(variogram.structured_sill * (1 - float(correlation.mean())), 0.0)


def property_weights(texts: Iterable[str]) -> dict[str, float]:
    """Namespaces of further properties, each with its weight.

    :param texts: ``NAMESPACE`` or ``NAMESPACE:WEIGHT``; names without a leading / are below the robot's
    :raises InputError: if a text has no valid namespace, or its weight is not a number from 0
    """
    found = {}
    for text in texts:
        name, colon, number = text.partition(":")
        try:
            weight = float(number) if colon else 1.0
        except ValueError:
            weight = math.nan
        if not _NAMESPACE.fullmatch(name) or not (math.isfinite(weight) and weight >= 0):
            remedy = "give words of letters, digits and _ with / between, such as /compaction or /compaction:0.5"
            raise InputError(f"properties: {text!r} is not a namespace with a weight from 0", remedy)
        found[name.rstrip("/")] = weight
    return found


def property_name(field: str) -> str:
    """Name of the property that a surrogate field simulates."""
    path = Path(field)
    text = path.stem if path.suffix in (".yaml", ".yml") else path.name
    name = re.sub("[^A-Za-z0-9]+", "_", text).strip("_")
    return name if re.fullmatch(_WORD, name) else f"property_{name}".rstrip("_")
