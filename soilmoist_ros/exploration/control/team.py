# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Several robots on one field: when one plans, pending measurements of the others count as done.

The kriging variance does not depend on the data, only on where was counted and for how long. So samples that are
still to come can be put into the kriging as they are expected, and their worth is taken off every place around.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.mission.types import MissionStatus
from soilmoist_ros.exploration.planning.planning_model import MIN_RATE_CPS
from soilmoist_ros.mapping.field_map import FieldMap
from soilmoist_ros.mapping.samples.samples import as_samples

Array = NDArray[np.float64]

MIN_EXPOSURE_S = 1e-3
"""What is counted in less changes no map; the variance of its rate need not be a number [s]."""
SAME_CELLS = 0.5
"""Stops nearer than this to that of another robot count as the same stop [cells]."""


@dataclass(frozen=True, slots=True)
class PendingMeasurement:
    """Where another robot is going or counting.

    :param x_m: east [m]
    :param y_m: north [m]
    :param exposure_s: what is still expected to be counted there [s]; 0: nothing, but the place is taken
    """

    x_m: float
    y_m: float
    exposure_s: float


def pending_measurement(status: MissionStatus, mapped_at_once: bool = True) -> PendingMeasurement | None:
    """PendingMeasurement of a robot, ``None`` if it has none.

    :param status: how its mission stands
    :param mapped_at_once: whether what it has counted at the stop is in the map already
    """
    stop = status.target
    if stop is None:
        return None
    left_s = status.planned_dwell_s - (status.dwell_s if mapped_at_once else 0.0)
    return PendingMeasurement(stop.x_m, stop.y_m, max(left_s, 0.0))


def foreseen(
    field_map: FieldMap, pending_measurements: Sequence[PendingMeasurement], factor: float = 1.0
) -> FieldMap:
    """The map as it will be: with a sample of each pending measurement, at the rate that the map expects there.

    :param field_map: the map so far; without a fit only the places join its samples
    :param pending_measurements: of the other robots
    :param factor: product of the correction factors now, ``effective exposure = exposure / factor`` [-]
    :returns: another map; the same without pending measurements at which something is to be counted
    :raises IllConditionedError: if the matrix cannot be factored
    """
    pending = [each for each in pending_measurements if each.exposure_s >= MIN_EXPOSURE_S]
    if not pending:
        return field_map
    rate = np.zeros(len(pending)) if field_map.kriging is None else field_map.kriging.predict(places(pending))[0]
    exposure_s = [each.exposure_s / factor for each in pending]
    counts = [round(max(r, MIN_RATE_CPS) * t) for r, t in zip(rate.tolist(), exposure_s, strict=True)]
    pending_samples = as_samples(places(pending), counts, exposure_s)
    expected, changing = field_map.samples.joined(pending_samples), field_map.changing
    ahead = FieldMap(field_map.grid, field_map.settings)
    if field_map.soil_map is None:
        ahead.set_samples(expected)
    else:
        ahead.set_samples(
            expected, field_map.soil_map.fit, None if changing is None else changing.joined(pending_samples)
        )
        ahead.update()
    return ahead


def taken(stops_xy: Array, pending_measurements: Sequence[PendingMeasurement], cell_m: float) -> NDArray[np.bool_]:
    """Which stops another robot has taken, shape (k,).

    :param stops_xy: places of the stops, shape (k, 2) [m]
    :param pending_measurements: of the other robots
    :param cell_m: size of the map's cells [m]
    """
    if not len(pending_measurements):
        return np.zeros(len(stops_xy), bool)
    away_m = np.linalg.norm(stops_xy[:, None, :] - places(pending_measurements)[None, :, :], axis=2)
    return np.asarray((away_m < SAME_CELLS * cell_m).any(axis=1))


def places(pending_measurements: Sequence[PendingMeasurement]) -> Array:
    """Where the pending measurements are, shape (n, 2) [m]."""
    return np.array([(each.x_m, each.y_m) for each in pending_measurements], float).reshape(-1, 2)
